"""How good a set of scenes is: errors against the wanted phi, coverage, tests of distribution. numpy only."""
