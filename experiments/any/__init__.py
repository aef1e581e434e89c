"""The model of any spec: random specs, exact scenes of them drawn as training goes, and what it is measured on."""
