"""Layered garments without intersections, in Blender: a panel in the sidebar of the 3D view.

The package ``ifgarments`` does the work; this add-on reads meshes, shows progress and stores
results.
"""

import bpy

from . import operators, panel, settings

_CLASSES = (*settings.CLASSES, *operators.CLASSES, *panel.CLASSES)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.if_garments = bpy.props.PointerProperty(type=settings.IFG_Settings)


def unregister():
    del bpy.types.Scene.if_garments
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
