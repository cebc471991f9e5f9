"""What a scene remembers: body, garments, and what is asked for."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)


def _is_mesh(_, thing):
    return thing.type == "MESH"


def _forget(_, context):
    context.scene.if_garments.forget()


class IFG_Garment(bpy.types.PropertyGroup):
    """A garment of the list."""

    mesh: PointerProperty(
        type=bpy.types.Object,
        name="Garment",
        description="A layer over the body and over the garments above it in this list",
        poll=_is_mesh,
        update=_forget,
    )


class IFG_Settings(bpy.types.PropertyGroup):
    """Settings of the panel."""

    body: PointerProperty(
        type=bpy.types.Object,
        name="Body",
        description="Never moves; it may be open, and must have an inside",
        poll=_is_mesh,
        update=_forget,
    )
    garments: CollectionProperty(type=IFG_Garment, name="Garments", description="Inner to outer")
    active: IntProperty(name="Active garment")
    clearance: FloatProperty(
        name="Clearance",
        description="Gap between layers",
        default=0.0003,
        min=0.0,
        soft_max=0.005,
        precision=5,
        step=0.01,
        unit="LENGTH",
    )
    strict: BoolProperty(
        name="Clean everywhere",
        description="No garment, nor the body, may intersect itself either",
    )
    what: EnumProperty(
        name="Meshes",
        description="Which meshes to check and to resolve",
        items=(
            ("MODELLED", "As modelled", "Meshes without modifiers; the result is a shape key"),
            (
                "FRAMES",
                "Frame range",
                "Meshes with their modifiers in each frame; the result is a point cache (PC2) that "
                "a Mesh Cache modifier plays",
            ),
        ),
    )
    caches: StringProperty(
        name="Caches",
        description="Folder of the point caches; // is the folder of the Blender file",
        subtype="DIR_PATH",
        default="//garments",
    )
    state: StringProperty(name="State", description="What the last run found")
    pairs: StringProperty(name="Pairs", description="Intersecting pairs of triangles, in lines")

    def forget(self):
        """What was found is not known of what is chosen now."""
        self.state = self.pairs = ""


CLASSES = (IFG_Garment, IFG_Settings)
