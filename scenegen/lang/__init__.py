"""The language: text -> syntax tree -> checked spec -> core formula, which every reader walks."""
