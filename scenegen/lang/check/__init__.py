"""Syntax tree -> core formula: names, shapes, supports, numbers of things, time, and what is wrong with them."""
