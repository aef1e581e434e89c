"""How often a policy succeeds: a logistic model of what a start tells, its file, and sampling by it. numpy only."""
