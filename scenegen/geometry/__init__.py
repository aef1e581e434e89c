"""Scalar primitives of the language: each written once, for any array namespace, with its unit and interval rule."""

from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, Polygon
from scenegen.geometry.interval import Interval
from scenegen.geometry.namespace import MATH, NUMPY, Namespace
from scenegen.geometry.primitives import ANGLE, BARE, LENGTH, PRIMITIVES, Primitive, Shape, Unit, UnitMismatch

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
