"""How scenes look: cameras, light, colours and textures, fixed or drawn at random, for pictures and simulators."""
