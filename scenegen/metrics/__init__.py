"""How good a set of scenes is: errors against the wanted phi, coverage of the truth. numpy only."""
