"""The file of a form: one rigid body at the origin, which scenes refer to, and which can be used by itself."""

from __future__ import annotations

from scenegen.assets.mesh import shaded
from scenegen.export.usd.axes import principal
from scenegen.export.usd.looks import SHADER, Look, cover, material, materials
from scenegen.export.usd.stage import Stage
from scenegen.export.world import Body, Form

CONTACT = "contact"  # the name of the material for contacts


def part(root: str, number: int) -> tuple[str, str]:
    """The path of a mesh that is drawn, and the name of its material."""
    return f"{root}/visuals/part_{number}", f"part_{number}"


def picture(form: Form, number: int) -> str:
    """The name of the file with the texture of a part, beside that of the form."""
    return f"{form.name}_{number}.png"


def body_file(body: Body) -> bytes:
    """The form of a body with its mass, friction and colours."""
    root = f"/{body.form.name}"
    stage = Stage(root, "component")
    moments, axes = principal(body.moments)
    stage.rigid(root, body.mass, body.form.inertia.center.tolist(), moments, axes)
    place = materials(stage, root)
    contact = f"{place}/{CONTACT}"
    stage.contact(contact, body.friction)
    stage.xform(f"{root}/visuals")
    for number, (mesh, color) in enumerate(zip(body.form.parts, body.colors, strict=True), start=1):
        path, name = part(root, number)
        stage.mesh(path, mesh, shaded(mesh)[1])
        material(stage, root, name, Look(color))
        cover(stage, root, path, name, color)
        paint = body.form.paints.get(number)
        if paint is not None:
            stage.places(path, paint.places[mesh.faces.ravel()])
            stage.image(f"{place}/{name}", SHADER, f"./{picture(body.form, number)}", color)
    stage.guide(f"{root}/collisions")
    for number, piece in enumerate(body.form.pieces, start=1):
        path = f"{root}/collisions/piece_{number}"
        if piece.box is None:
            stage.mesh(path, piece.mesh)
        else:
            stage.box(path, *piece.box)
        stage.collider(path, contact, hull=piece.box is None)
    return stage.finished().text()
