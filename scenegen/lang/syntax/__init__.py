"""Text -> syntax tree, and back: parser, errors of syntax, canonical print and formatter."""
