"""The paper's figures, one module each: scenes or curves in, a PNG file out."""
