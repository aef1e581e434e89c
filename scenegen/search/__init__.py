"""What phi can be, and where, in numpy: interval bounds, contraction, branch and prune, and what clashes.

`prune` covers the scenes of a range by disjoint sets to draw from; `conflict` names the smallest set of conjuncts that
no scene meets; `prune.find_witness` looks for a scene. The last two are light enough for `scenegen check`.
"""

from scenegen.search.contract import label_bounds, node_bounds, spec_bounds

__all__ = ["label_bounds", "node_bounds", "spec_bounds"]
