"""How good a set of scenes is: errors against the target phi, coverage, tests of distribution. numpy only."""
