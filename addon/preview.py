"""Material, world and light previews: small, few samples, in Blender's preview thread beside whatever else renders."""

from typing import Any

from . import final, passes
from .sessions import open_session


def render(engine: Any, state: final.FinalState, depsgraph: Any) -> None:
    """Renders Blender's preview scene. Warnings are not reported: the same shader says them in the render."""
    scene = depsgraph.scene_eval
    layer = depsgraph.view_layer_eval
    with final.result_of(engine, engine.resolution_x, engine.resolution_y, layer.name) as result:
        if engine.test_break() or not result.layers:
            return
        synced = open_session()
        session = synced.session
        synced.sync.full(
            depsgraph,
            scene,
            layer,
            width=engine.resolution_x,
            height=engine.resolution_y,
            viewport=False,
            preview=True,
        )
        combined = [passes.Pass(passes.COMBINED, "combined", 4, "RGBA")]
        session.set_passes(["combined"])
        state.running = session
        try:
            _run(engine, session)
            pixels = result.resolution_x * result.resolution_y
            passes.write(result.layers[0], "", combined, session, pixels)
        finally:
            session.stop()
            state.running = None


def _run(engine: Any, session: Any) -> None:
    session.start()
    while not session.wait(50):
        if engine.test_break():
            session.cancel()
            session.stop()
            return
    final.check_failed(session, session.progress())
