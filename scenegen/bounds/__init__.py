"""What phi can be: interval bounds over boxes of poses, in numpy."""

from scenegen.bounds.interval import label_bounds, node_bounds, spec_bounds

__all__ = ["label_bounds", "node_bounds", "spec_bounds"]
