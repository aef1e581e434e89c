"""Drawing scenes for a range of phi: plain rejection, or any proposer whose scenes are refined; all verified."""
