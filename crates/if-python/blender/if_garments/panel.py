"""The panel in the sidebar."""

import bpy


class IFG_UL_garments(bpy.types.UIList):
    """Garments, inner to outer"""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        layout.prop(item, "mesh", text=f"{index + 1}", icon="MATCLOTH")


class IFG_PT_panel(bpy.types.Panel):
    """Body, garments, and what to do"""

    bl_label = "Intersection-free garments"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Garments"

    def draw(self, context):
        layout, settings = self.layout, context.scene.if_garments
        layout.prop(settings, "body")
        layout.label(text="Garments, inner to outer")
        row = layout.row()
        row.template_list("IFG_UL_garments", "", settings, "garments", settings, "active", rows=4)
        column = row.column(align=True)
        column.operator("if_garments.add", text="", icon="ADD")
        column.operator("if_garments.remove", text="", icon="REMOVE")
        column.separator()
        column.operator("if_garments.move", text="", icon="TRIA_UP").step = -1
        column.operator("if_garments.move", text="", icon="TRIA_DOWN").step = 1
        layout.prop(settings, "clearance")
        layout.prop(settings, "strict")
        layout.prop(settings, "what")
        if settings.what == "FRAMES":
            layout.prop(settings, "caches")
        row = layout.row(align=True)
        row.operator("if_garments.check")
        row.operator("if_garments.resolve")
        if settings.state:
            icon = "ERROR" if settings.state == "not clean" else "CHECKMARK"
            layout.label(text=settings.state.capitalize(), icon=icon)
        if settings.pairs:
            column = layout.column(align=True)
            column.label(text="Intersecting pairs of triangles:")
            for line in settings.pairs.split("\n"):
                column.label(text=line)
            column.label(text="Edit mode (Tab) shows them", icon="EDITMODE_HLT")


CLASSES = (IFG_UL_garments, IFG_PT_panel)
