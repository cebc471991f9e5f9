"""Presses the buttons of the Blender panel in a window, and writes what the window shows.

    xvfb-run -s "-screen 0 1280x800x24" blender --factory-startup --window-geometry 0 0 1280 800 \
        --python benches/blender_panel.py -- EXTENSION.zip OUT BODY.ply GARMENT.ply ...

Garments from inner to outer, up to four. OUT gets start.png, check.png, resolve.png, undo.png.
Needs ImageMagick. The extension is installed: set BLENDER_USER_RESOURCES to an empty folder to
keep it out of your own settings.
"""

import pathlib
import subprocess
import sys

import bpy

COLOURS = ((0.8, 0.6, 0.5), (0.8, 0.8, 0.3), (0.3, 0.6, 0.4), (0.3, 0.4, 0.8), (0.7, 0.7, 0.75))
DRAWN = 3.0  # seconds until the window shows a change, in software OpenGL
extension, out, *files = (pathlib.Path(a).resolve() for a in sys.argv[sys.argv.index("--") + 1 :])
out.mkdir(parents=True, exist_ok=True)


def view():
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    return window, area, {region.type: region for region in area.regions}


def inside():
    window, area, regions = view()
    return bpy.context.temp_override(window=window, area=area, region=regions["WINDOW"])


def picture(name):
    """What the display shows: Blender's own screenshots are black in software OpenGL."""
    subprocess.run(["import", "-window", "root", out / f"{name}.png"], check=True)


def scene():
    """Imports the meshes, and chooses them in the panel."""
    install = bpy.ops.extensions.package_install_files
    install(filepath=str(extension), repo="user_default", enable_on_install=True)
    bpy.data.batch_remove(bpy.data.objects)
    settings = bpy.context.scene.if_garments
    for k, (file, colour) in enumerate(zip(files, COLOURS)):
        bpy.ops.wm.ply_import(filepath=str(file), forward_axis="NEGATIVE_Z", up_axis="Y")
        bpy.ops.object.shade_smooth()
        bpy.context.object.color = (*colour, 1.0)
        where, name = (settings.garments.add(), "mesh") if k else (settings, "body")
        setattr(where, name, bpy.context.object)
    space = view()[1].spaces.active
    space.show_region_ui = True
    space.shading.color_type = "OBJECT"
    with inside():
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
        bpy.ops.object.select_all(action="DESELECT")
        bpy.ops.ed.undo_push(message="Outfit")


def steps():
    """What is done, with the seconds to wait after it."""
    try:
        scene()
        yield DRAWN
        view()[2]["UI"].active_panel_category = "Garments"
        view()[1].tag_redraw()
        yield DRAWN
        picture("start")
        for button in ("check", "resolve"):
            with inside():
                getattr(bpy.ops.if_garments, button)("INVOKE_DEFAULT", True)
            yield DRAWN
            while view()[0].modal_operators:
                yield 0.5
            yield DRAWN
            picture(button)
        with inside():
            bpy.ops.ed.undo()
        yield DRAWN
        picture("undo")
    finally:
        bpy.ops.wm.quit_blender()


bpy.context.preferences.view.show_splash = False
left = steps()
bpy.app.timers.register(lambda: next(left, None), first_interval=1.0)
