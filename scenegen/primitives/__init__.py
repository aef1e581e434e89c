"""Scalar primitives of the language: each written once, for any array namespace, with its unit and interval rule."""

from scenegen.primitives.footprint import POINT, Box, Circle, Footprint, Polygon
from scenegen.primitives.interval import Interval
from scenegen.primitives.namespace import MATH, NUMPY, Namespace
from scenegen.primitives.table import PRIMITIVES, Primitive, Shape
from scenegen.primitives.units import ANGLE, BARE, LENGTH, Unit, UnitMismatch

__all__ = [
    "ANGLE",
    "BARE",
    "LENGTH",
    "MATH",
    "NUMPY",
    "POINT",
    "PRIMITIVES",
    "Box",
    "Circle",
    "Footprint",
    "Interval",
    "Namespace",
    "Polygon",
    "Primitive",
    "Shape",
    "Unit",
    "UnitMismatch",
]
