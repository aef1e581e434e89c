"""Drawing scenes for a range of phi: pruned rejection, or any proposer whose scenes are refined; all verified."""
