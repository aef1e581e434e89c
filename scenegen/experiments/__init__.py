"""The paper's tables and figures, one module each. `table` lists them and imports nothing heavy."""
