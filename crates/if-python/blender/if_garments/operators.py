"""The buttons. Work runs in a thread of its own and can be cancelled with Escape."""

import contextlib
import threading

import bpy
import ifgarments

from . import tasks
from .meshes import MeshError

# What a task may raise: shown as a message.
_ERRORS = (MeshError, tasks.Unfinished, ifgarments.Error, ValueError, OSError, ReferenceError)
# Starts of the names of events that turn the view, and of those that do nothing: only these pass
# while a task works. Others could undo or edit what it has read.
_PASSING = (
    *("MIDDLE", "WHEEL", "TRACKPAD", "MOUSE", "INBETWEEN", "NDOF", "TIMER", "WINDOW"),
    *(f"NUMPAD_{k}" for k in range(10)),
)


class _Job(threading.Thread):
    """A call in a thread of its own: it must not touch the scene, nor the operator."""

    def __init__(self, call):
        super().__init__(daemon=True)
        self._call, self.cancelled = call, False
        self.progress, self.result, self.error = "", None, None

    def run(self):
        try:
            self.result = self._call(self._listen)
        except BaseException as error:  # raised again in the main thread
            self.error = error

    def _listen(self, progress):
        self.progress = progress
        if self.cancelled:
            raise ifgarments.Cancelled("cancelled")


class _Run:
    """An operator that drives a task; in background mode at once, else with progress."""

    bl_options = {"REGISTER", "UNDO"}
    #: Whether one of these operators works in a window: one at a time.
    working = False

    def execute(self, context):
        task, sent = type(self).task(context), None
        try:
            while True:
                sent = task.send(sent)(lambda _: None)
        except StopIteration as end:
            return self._ended(end.value)
        except _ERRORS as error:
            return self._failed(context, error)

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        if _Run.working:  # in another window
            self.report({"WARNING"}, "garments are being worked on; Escape cancels")
            return {"CANCELLED"}
        self._task, self._job, self._cancelled = type(self).task(context), None, False
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.1, window=context.window)
        manager.modal_handler_add(self)
        _Run.working = True
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._stop()
            context.workspace.status_text_set("Garments: cancelling …")
        if event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type.startswith(_PASSING) else {"RUNNING_MODAL"}
        job = self._job
        if job is not None and job.is_alive():
            if not self._cancelled:
                text = f"Garments: {job.progress or 'working'} (Esc cancels)"
                context.workspace.status_text_set(text)
            return {"PASS_THROUGH"}
        try:
            if job is not None and job.error is not None:
                self._task.close()
                raise job.error
            if self._cancelled:
                self._task.close()
                raise ifgarments.Cancelled("cancelled")
            work = self._task.send(None if job is None else job.result)
        except StopIteration as end:
            self._clear(context)
            return self._ended(end.value)
        except _ERRORS as error:
            self._clear(context)
            return self._failed(context, error)
        except BaseException:
            self._clear(context)
            raise
        self._job = _Job(work)
        self._job.start()
        return {"PASS_THROUGH"}

    def cancel(self, context):
        """Blender ends the operator: it closes the window, or opens a file."""
        self._stop()
        with contextlib.suppress(ReferenceError):
            self._task.close()
        _Run.working = False

    def _stop(self):
        self._cancelled = True
        if self._job is not None:
            self._job.cancelled = True

    def _clear(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        _Run.working = False

    def _ended(self, message):
        self.report({"INFO"}, message)
        return {"FINISHED"}

    def _failed(self, context, error):
        if isinstance(error, ifgarments.Cancelled):
            self.report({"INFO"}, "cancelled")
            return {"CANCELLED"}
        if isinstance(error, ReferenceError):
            error = "objects were removed or undone meanwhile; start again"
        self.report({"ERROR"}, str(error))
        if isinstance(error, tasks.Unfinished):
            return {"FINISHED"}  # what was reached is in the scene, and can be undone
        context.scene.if_garments.forget()
        return {"CANCELLED"}


class IFG_OT_check(_Run, bpy.types.Operator):
    """Counts intersections. Edit mode shows them selected; they become a vertex group, too"""

    bl_idname = "if_garments.check"
    bl_label = "Check"
    task = tasks.check


class IFG_OT_resolve(_Run, bpy.types.Operator):
    """Makes the garments free of intersections, and proves it; the meshes themselves stay"""

    bl_idname = "if_garments.resolve"
    bl_label = "Resolve"
    task = tasks.resolve


class IFG_OT_add(bpy.types.Operator):
    """Adds the selected meshes as outer layers"""

    bl_idname = "if_garments.add"
    bl_label = "Add selected"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        settings = context.scene.if_garments
        known = {settings.body, *(item.mesh for item in settings.garments)}
        chosen = [t for t in context.selected_objects if t.type == "MESH" and t not in known]
        if not chosen:
            self.report({"WARNING"}, "select meshes that are not in the list yet")
            return {"CANCELLED"}
        for thing in chosen:
            settings.garments.add().mesh = thing
        settings.active = len(settings.garments) - 1
        return {"FINISHED"}


class IFG_OT_remove(bpy.types.Operator):
    """Removes the garment from the list; the object stays"""

    bl_idname = "if_garments.remove"
    bl_label = "Remove"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        settings = context.scene.if_garments
        if not 0 <= settings.active < len(settings.garments):
            return {"CANCELLED"}
        settings.garments.remove(settings.active)
        settings.forget()
        settings.active = max(0, min(settings.active, len(settings.garments) - 1))
        return {"FINISHED"}


class IFG_OT_move(bpy.types.Operator):
    """Moves the garment inwards or outwards"""

    bl_idname = "if_garments.move"
    bl_label = "Move"
    bl_options = {"REGISTER", "UNDO"}

    step: bpy.props.IntProperty(name="Step", default=1)

    def execute(self, context):
        settings = context.scene.if_garments
        to = settings.active + self.step
        if not 0 <= to < len(settings.garments):
            return {"CANCELLED"}
        settings.garments.move(settings.active, to)
        settings.forget()
        settings.active = to
        return {"FINISHED"}


CLASSES = (IFG_OT_check, IFG_OT_resolve, IFG_OT_add, IFG_OT_remove, IFG_OT_move)
