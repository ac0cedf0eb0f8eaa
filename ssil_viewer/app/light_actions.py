"""What keys, menus and panels can do with the lights and the environment."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ssil_viewer import output, saved_view
from ssil_viewer.app.camera_actions import shows_errors
from ssil_viewer.app.exposure_choice import ExposureChoice
from ssil_viewer.app.light_motion import LightMotion
from ssil_viewer.app.state import AppState
from ssil_viewer.scene.environment import Environment, load_environment
from ssil_viewer.scene.light_file import with_lights
from ssil_viewer.scene.lights import with_default_light, without_default_light
from ssil_viewer.scene.model import Light


class LightActions:
    """The verbs of light; `Actions` has them with all others."""

    state: AppState
    exposure: ExposureChoice
    # The default sun as it was when an environment took its place
    _sun_put_away: tuple[Light, ...] = ()

    @shows_errors
    def load_lights(self, path: Path) -> None:
        """The lights of a file, in place of those that are there or on top of them, as the file says."""
        self._set_lights(with_lights(replace(self.state.scene, lights=self.state.lights), path).lights)
        self.exposure.light_changed()
        self.state.say(f"Lights of {path}")

    @shows_errors
    def save_lights(self) -> None:
        """Write the lights, those that move where they are now, to the working directory, under a new name."""
        lights = self.state.motion.applied(self.state.lights)
        self.state.say(f"Saved {saved_view.save_lights(output.working_folder(), lights)}")

    def pause_light(self) -> None:
        """Pause or resume the moving light; the first light moves when none did."""
        state = self.state
        if state.motion.light is not None:
            state.motion = replace(state.motion, paused=not state.motion.paused)
        elif state.lights:
            state.motion = replace(state.motion, light=0, paused=False, reach=0.15 * state.camera.scene_radius)
        else:
            state.say("There is no light to move")

    @shows_errors
    def open_environment(self, path: Path) -> None:
        """Light the scene with a map from now on; a default sun goes meanwhile, except beside a clear sky."""
        environment = load_environment(path)
        self._set_environment(environment)
        for warning in environment.warnings:
            self.state.say(warning, "error")
        self.state.say(f"Environment {path}")

    def remove_environment(self) -> None:
        """No environment from now on."""
        self._set_environment(None)

    def _set_environment(self, environment: Environment | None) -> None:
        state, before = self.state, self.state.scene.environment
        state.scene = replace(state.scene, environment=environment)
        lights = state.lights
        was_replaced = before is not None and before.replaces_sun
        if environment is not None and environment.replaces_sun:
            if not was_replaced:
                self._sun_put_away = ()
            lights = self._put_sun_away(lights)
        elif was_replaced:
            lights += self._sun_put_away
            self._sun_put_away = ()
            if not lights and not state.scene.lights:   # it was opened with that environment
                lights = with_default_light(replace(state.scene, lights=(), environment=None)).lights
        if lights != state.lights:
            self._set_lights(lights)
        self.exposure.light_changed()

    def _put_sun_away(self, lights: tuple[Light, ...]) -> tuple[Light, ...]:
        """The lights without the default sun, which is kept for when the environment goes."""
        left = without_default_light(lights)
        if left != lights:
            self._sun_put_away = tuple(light for light in lights if light not in left)
        return left

    def _set_lights(self, lights: tuple[Light, ...] | None) -> None:
        """Lights of a file or picture, if it has them."""
        if lights is not None:
            self.state.lights, self.state.motion = lights, LightMotion()
