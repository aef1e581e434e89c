"""Charts and drawings without a renderer: top views, heat maps, curves, sheets."""
