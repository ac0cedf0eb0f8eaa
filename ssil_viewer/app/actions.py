"""Everything that keys, menus and panels can ask for. A user's mistake becomes a message, never an end."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Callable, get_args

import numpy as np

from ssil_viewer import output, saved_view
from ssil_viewer.app.benchmark import WindowBenchmark
from ssil_viewer.app.camera_actions import CameraActions, WindowControl, shows_errors
from ssil_viewer.app.exposure_choice import ExposureChoice
from ssil_viewer.app.light_actions import LightActions
from ssil_viewer.app.light_motion import LightMotion
from ssil_viewer.app.other_settings import OtherSettings, with_display_of
from ssil_viewer.app.recent_scenes import RecentScenes
from ssil_viewer.app.reference import WindowReference
from ssil_viewer.app.scene_loading import Loaded, SceneLoader
from ssil_viewer.app.state import AppState, ReferenceKind
from ssil_viewer.app.undo import History, Snapshot, difference
from ssil_viewer.errors import UserError
from ssil_viewer.pipeline import Renderer
from ssil_viewer.resources import BUILTIN_PREFIX
from ssil_viewer.scene.builtin_sky import SKIES
from ssil_viewer.scene.environment import FORMATS as ENVIRONMENT_FORMATS
from ssil_viewer.scene.light_file import is_light_file
from ssil_viewer.scene.model import Camera, Light
from ssil_viewer.settings import Settings, load_preset, load_settings, of_display

_SHOW_MODES = ("both", "direct", "indirect", "glossy")


class Actions(CameraActions, LightActions):
    """The verbs of the window. Names in `keys.BINDINGS` are methods here.

    Args:
        state: Changed by the actions.
        renderer: Asked for pictures, buffers and shaders.
        loader: Loads scenes in the background.
        window: What only the window can do.
    """

    def __init__(self, state: AppState, renderer: Renderer, loader: SceneLoader, window: WindowControl) -> None:
        self.state = state
        self._renderer = renderer
        self._loader = loader
        self._window = window
        self.benchmark = WindowBenchmark(state, renderer)
        self.reference = WindowReference(state, renderer)
        self.other = OtherSettings(state, renderer)
        self.history = History()
        self.recent = RecentScenes()
        self.exposure = ExposureChoice(state, renderer, self._note_own_exposure)
        self._view_after_loading: tuple[Camera, float] | None = None    # with its `aside`
        self._settings_after_loading: Settings | None = None
        self._lights_after_loading: tuple[Light, ...] | None = None
        # The file browser puts itself here
        self.on_browse: Callable[[Path | None], None] = lambda folder: None

    # What is shown

    def set_settings(self, settings: Settings) -> None:
        """Replace all settings at once; the next frame uses them."""
        self.state.settings = settings

    @shows_errors
    def show(self, mode: str) -> None:
        """Show "both", "direct", "indirect" or "glossy", in place of any buffer."""
        self.state.settings = self.state.settings.replaced({"show": mode})
        self.state.buffer = None

    def show_both(self) -> None:
        """Show direct and indirect light."""
        self.show("both")

    def show_direct(self) -> None:
        """Show direct light only."""
        self.show("direct")

    def show_indirect(self) -> None:
        """Show indirect light only."""
        self.show("indirect")

    def show_glossy(self) -> None:
        """Show the reflection of indirect light only."""
        self.show("glossy")

    def show_next(self) -> None:
        """Go round both, direct, indirect, glossy."""
        self.show(_SHOW_MODES[(_SHOW_MODES.index(self.state.settings.show) + 1) % len(_SHOW_MODES)])

    def meter_exposure(self) -> None:
        """Choose the exposure from the light that is shown."""
        self.exposure.ask()

    def step_buffer_back(self) -> None:
        """Show the previous buffer; before the first comes the image."""
        self._step_buffer(-1)

    def step_buffer_forward(self) -> None:
        """Show the next buffer; after the last comes the image."""
        self._step_buffer(1)

    def step_level_down(self) -> None:
        """Show a finer level of the buffer."""
        self._step_level(-1)

    def step_level_up(self) -> None:
        """Show a coarser level of the buffer."""
        self._step_level(1)

    def keep_settings(self) -> None:
        """Keep the settings of now as B, and show both side by side; or show A alone again."""
        if self.state.other is None:
            self.state.other, self.state.reference = self.state.settings, "off"
            self.state.say("Kept as B: change the settings to see A beside it")
        else:
            self.state.other = None

    def swap_settings(self) -> None:
        """A becomes B and B becomes A."""
        if self.state.other is not None:
            now = self.state.settings
            self.state.settings, self.state.other = with_display_of(self.state.other, now), now

    def next_reference(self) -> None:
        """Go round no reference, R1 and R2."""
        names = get_args(ReferenceKind)
        self.set_reference(names[(names.index(self.state.reference) + 1) % len(names)])

    def set_reference(self, name: ReferenceKind) -> None:
        """Compare with a reference, in place of any buffer, or stop comparing."""
        self.state.reference = name
        if name != "off":
            self.state.buffer = None

    def toggle_error(self) -> None:
        """Show the error against the reference, or the image under its light."""
        self.state.reference_view = "image" if self.state.reference_view == "error" else "error"

    def toggle_split(self) -> None:
        """Our picture beside what is shown of the reference, or that alone."""
        self.state.split_view = not self.state.split_view

    def toggle_inspector(self) -> None:
        """Values under the cursor on and off."""
        self.state.inspector = not self.state.inspector

    # Pictures and settings files

    @shows_errors
    def save_image(self) -> None:
        """Write the rendered image, without panels, to the working directory."""
        self.save_pixels((self.other if self.other.shown else self.reference).read())

    def save_window(self) -> None:
        """Write the window with its panels, as soon as this frame is drawn."""
        self._window.save_after_frame()

    @shows_errors
    def save_pixels(self, rgb: np.ndarray) -> None:
        """Write a picture that remembers scene, settings, camera and lights.

        Args:
            rgb: (H, W, 3) uint8, row 0 = top.
        """
        environment = self.state.scene.environment
        # While new settings are prepared, the picture still has those of the renderer
        settings = self._renderer.settings if self.state.preparing else self.state.settings
        view = saved_view.SavedView(self.state.scene.name, settings, self.state.camera.camera(),
                                    environment.name if environment else "",
                                    self.state.motion.applied(self.state.lights))
        details = {"renderer": self._renderer.capabilities.renderer, "opengl": self._renderer.capabilities.version,
                   "size": [rgb.shape[1], rgb.shape[0]]}
        path = saved_view.save_picture(output.working_folder(), rgb, view, details)
        self.state.say(f"Saved {path}")

    @shows_errors
    def use_preset(self, name: str) -> None:
        """Settings of a shipped preset; those that only concern the display stay."""
        self.state.settings = load_preset(name, Settings().replaced(of_display(self.state.settings)))
        self.state.say(f"Preset {name}", topic="settings")

    @shows_errors
    def load_settings(self, path: Path) -> None:
        """Settings of a file, over the defaults; the scene keeps an exposure that the user has not chosen."""
        unchosen = self.exposure.unchosen
        self.state.settings = load_settings(path, None if unchosen is None else Settings(exposure=unchosen))
        self.state.say(f"Settings of {path}", topic="settings")

    @shows_errors
    def save_settings(self) -> None:
        """Write the settings that differ from the defaults to the working directory, under a new name."""
        self.state.say(f"Saved {saved_view.save_settings(output.working_folder(), self.state.settings)}")

    def undo(self) -> None:
        """Take the last change of settings, A or B, lights or environment back."""
        self._go_to(self.history.back(self._snapshot()), "Undone", "undo")

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        self._go_to(self.history.forward(self._snapshot()), "Redone", "redo")

    def note_changes(self, busy: bool) -> None:
        """Remember what can be undone. Call it once a turn; `busy`: a change goes on, such as the drag of a slider."""
        self.history.look(self._snapshot(), busy)

    def _note_own_exposure(self, exposure: float) -> None:
        self.note_changes(busy=False)   # also one that goes on: it would be the state before that gets the exposure
        self.history.absorb_exposure(exposure)

    def _snapshot(self) -> Snapshot:
        state = self.state
        return Snapshot(state.settings, state.lights, state.scene.environment, state.other, self.exposure.own,
                        self.exposure.of_picture)

    def _go_to(self, snapshot: Snapshot | None, done: str, verb: str) -> None:
        if snapshot is None:
            self.state.say(f"Nothing to {verb}", topic="undo")
            return
        state, now = self.state, self._snapshot()
        state.say(f"{done}: {difference(now, snapshot)}", topic="undo")
        state.settings, state.other = snapshot.settings, snapshot.other
        self.exposure.came_back(snapshot.own_exposure, snapshot.exposure_of_picture)
        if (snapshot.lights, snapshot.environment) != (now.lights, now.environment):
            # Which light moves is told by its place in the list
            state.lights, state.motion = snapshot.lights, LightMotion()
            state.scene = replace(state.scene, environment=snapshot.environment)

    @shows_errors
    def start_benchmark(self) -> None:
        """Measure the present view under the settings of the talk's timing table."""
        self.benchmark.start()

    @shows_errors
    def save_benchmark(self) -> None:
        """Write what was measured to the working directory."""
        self.state.say(f"Saved {self.benchmark.save(output.working_folder())}")

    # The scene

    @shows_errors
    def open_path(self, path: Path) -> None:
        """Open whatever was dropped or chosen: a scene, an environment, settings, lights, or a saved picture."""
        suffix = path.suffix.lower()
        if os.fspath(path).removeprefix(BUILTIN_PREFIX) in SKIES:
            self.open_environment(path)
        elif suffix == ".toml" and is_light_file(path):
            self.load_lights(path)
        elif suffix == ".toml":
            self.load_settings(path)
        elif suffix in ENVIRONMENT_FORMATS:
            self.open_environment(path)
        elif suffix == ".png":
            self._restore(saved_view.load_picture(path))
        else:
            self.open_scene(os.fspath(path))

    def browse_scene(self) -> None:
        """Let the user choose a file, at first beside the scene that is open."""
        path = Path(self.state.scene.name)
        self.on_browse(path.parent if path.is_file() else None)

    def open_scene(self, source: str) -> None:
        """Load a scene in the background; the present one stays until it is there."""
        self._view_after_loading = self._settings_after_loading = self._lights_after_loading = None
        self.state.loading = source
        self._loader.start(source)

    def reload_scene(self) -> None:
        """Load the scene again, and keep the camera."""
        view = self.state.camera.camera(), self.state.camera.aside
        self.open_scene(self.state.scene.name)
        self._view_after_loading = view

    def poll_loader(self) -> None:
        """Take over a scene that has been loaded. Call once per frame."""
        outcome = self._loader.poll()
        self.state.loading = self._loader.loading
        if outcome is not None:
            self._take(outcome)

    # The program

    def toggle_help(self) -> None:
        """The list of keys on and off."""
        self.state.help_open = not self.state.help_open

    def toggle_panels(self) -> None:
        """All panels on and off."""
        self.state.panels_visible = not self.state.panels_visible

    def toggle_timings(self) -> None:
        """The table of pass times on and off."""
        self.state.timings_visible = not self.state.timings_visible

    def toggle_fullscreen(self) -> None:
        """Full screen on and off."""
        self._window.toggle_fullscreen()

    def set_vsync(self, on: bool) -> None:
        """Wait for the monitor at the end of each frame, or not."""
        self.state.vsync = on
        self._window.set_vsync(on)

    def reload_shaders(self) -> None:
        """Compile the shaders anew; after an error the old programs go on."""
        self.state.shader_error = self._renderer.reload_shaders() or ""
        self.state.shader_generation += 1
        if not self.state.shader_error:
            self.state.say("Shaders loaded")

    def quit(self) -> None:
        """Close the window."""
        self._window.close()

    def keep_buffer_valid(self) -> None:
        """Drop a buffer that the settings took away, and keep its level among those that there are."""
        if self.state.buffer is not None:
            if self.state.buffer not in self._renderer.buffers():
                self.state.buffer = None
            self.state.level = self._level_in_range(self.state.level)

    def _step_buffer(self, step: int) -> None:
        names: list[str | None] = [None, *self._renderer.buffers()]
        at = names.index(self.state.buffer) if self.state.buffer in names else 0
        self.state.buffer = names[(at + step) % len(names)]
        self.state.level = self._level_in_range(self.state.level)
        self.state.say(f"Showing {self.state.buffer or 'the image'}", topic="buffer")

    def _step_level(self, step: int) -> None:
        self.state.level = self._level_in_range(self.state.level + step)

    def _level_in_range(self, level: int) -> int:
        info = self._renderer.buffers().get(self.state.buffer or "")
        return min(max(level, info.levels[0]), info.levels[-1]) if info and info.levels else 0

    def _restore(self, view: saved_view.SavedView) -> None:
        now = self.state.scene.environment
        if view.environment and (now is None or now.name != view.environment):
            self.open_environment(Path(view.environment))
        elif view.environment == "" and now is not None:
            self.remove_environment()
        if view.scene and view.scene != self.state.scene.name:
            # They mean nothing without their scene, which may be gone.
            self.open_scene(view.scene)
            self._view_after_loading, self._settings_after_loading = (view.camera, 0.0), view.settings
            self._lights_after_loading = view.lights
            return
        self.state.settings = view.settings
        self.state.camera.set_camera(view.camera)
        self._take_over_rest(view.lights)

    def _take_over_rest(self, lights: tuple[Light, ...] | None) -> None:
        """Of a picture whose camera and settings are there."""
        self.exposure.picture_opened()
        self._set_lights(lights)
        self.state.say("Settings and camera of the picture" if lights is None else
                       "Settings, camera and lights of the picture")

    @shows_errors
    def _take(self, outcome: Loaded) -> None:
        view, settings, lights = self._view_after_loading, self._settings_after_loading, self._lights_after_loading
        self._view_after_loading = self._settings_after_loading = self._lights_after_loading = None
        if outcome.scene is None or outcome.camera is None:
            raise UserError(outcome.error)
        scene, environment = outcome.scene, self.state.scene.environment
        self._sun_put_away = ()
        if environment is not None:     # the user's choice outlives the scene
            kept = self._put_sun_away(scene.lights) if environment.replaces_sun else scene.lights
            scene = replace(scene, environment=environment, lights=kept)
        self._renderer.set_scene(scene)
        self.state.open_scene(scene, outcome.camera)
        self.recent.add(outcome.source)
        self.history.forget()
        self.benchmark.visible &= self.benchmark.running    # of the old scene; its numbers can still be saved
        if view is not None:
            self.state.camera.set_camera(*view)
        else:
            self.reset_camera()
        if settings is not None:
            self.state.settings = settings
            self._take_over_rest(lights)
        elif view is None:
            self.exposure.light_changed(new_scene=True)
        count = len(outcome.scene.warnings)
        self.state.say(f"Opened {outcome.source}"
                       + (f", {count} warning{'s' if count > 1 else ''}: see Scene" if count else ""))
