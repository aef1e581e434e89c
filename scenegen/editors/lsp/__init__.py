"""The language server: diagnostics, hover, completion, definitions and formatting over stdio."""
