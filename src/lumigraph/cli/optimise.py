"""`lumigraph optimise`: the best camera for a goal, of all that can be made."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from lumigraph.cli import files, optimised
from lumigraph.cli.console import line, progress
from lumigraph.cli.options import Output, length, section
from lumigraph.cli.options import planes as planes_of
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    import numpy as np

    from lumigraph.instruments import Instrument
    from lumigraph.studies.information import Scenes
    from lumigraph.studies.optimisation import Goal


@Parameter(name="*", group=section("Goal"))
@dataclass(frozen=True)
class GoalOptions:
    """Goal of the optimisation.

    Parameters
    ----------
    goal
        depth, lateral or brightness: bounds of a point's errors over --depth. picture error: what the best
        linear reconstruction of scenes leaves, at each of --depth; volume error: the same with scenes at all
        depths at once; reconstruction: the same at one of --depth that is not known, by one linear rule that
        is trained with each camera. Or 'largest' or 'least' and a
        number's name: light caught, one that 'lumigraph design' prints, or a simulated one of 'lumigraph
        sweep', such as 'largest mtf@10/mm', the least over --depth.
    against
        A second goal, as --goal: prints and draws the cameras that no other beats in both. Searches for it
        may take as many --evaluations again.
    depth
        Depths from the focused plane, such as '-5 mm:5 mm:5 mm'; may be repeated.
    photons
        Photons of a point, or of a scene's mean sample, that enter the camera as it is given; others get
        theirs by their aperture.
    background
        Photons of even light on each pixel.
    places
        Points at each depth; left out, as many as leave 1 % of the bound unknown, up to 16. More make
        it smoother over what varies, and take longer.
    scenes
        Pictures, whose contrast and power over frequency scenes have, for the errors of reconstruction;
        values count as light. Left out, 30 % of contrast and power 1/f².
    scene_pitch
        Pixel pitch of the pictures in the object, such as '10 um': half scenes' finest period. Left out,
        half of what the camera as given resolves in focus.
    scene_samples
        Across a scene, which is as wide as so many pixels; the time grows with them.
    held_out
        Pictures held out from the search, of the same --scene-pitch: 16 squares of them at most are
        reconstructed from drawn raw images before the camera as given, the best of the first values and the
        best, as if they were like the --scenes. Warns where the best is not better there.
    """

    goal: str = "depth"
    against: str | None = None
    depth: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True, negative="")] = None
    photons: Annotated[float, Parameter(allow_leading_hyphen=True)] = 10_000.0
    background: Annotated[float, Parameter(allow_leading_hyphen=True)] = 0.0
    places: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    scenes: Annotated[list[Path] | None, Parameter(consume_multiple=True, negative="")] = None
    scene_pitch: str | None = None
    scene_samples: Annotated[int, Parameter(allow_leading_hyphen=True)] = 32
    held_out: Annotated[list[Path] | None, Parameter(consume_multiple=True, negative="")] = None

    def read(self, given: "Instrument") -> "Goal":
        """The goal, of a camera to begin with; refuses nonsense."""
        from lumigraph.studies.information import Light
        from lumigraph.studies.optimisation import Goal

        planes = () if self.depth is None else planes_of("--depth", self.depth)
        light = Light(self.photons, self.background)
        goal = Goal.parse(self.goal, planes, light, self.places)
        return replace(goal, scenes=self._scenes(goal.ready(given).scenes))

    def _scenes(self, usual: "Scenes | None") -> "Scenes | None":
        """Scenes for pictures and numbers; None if the goal needs none."""
        from lumigraph.studies.information import Scenes

        asked = (
            bool(self.scenes)
            or self.scene_pitch is not None
            or self.scene_samples != GoalOptions.scene_samples
        )
        if usual is None and asked:
            raise FormatError(
                f"--scenes, --scene-pitch and --scene-samples are for the goals 'picture error', 'volume "
                f"error' and 'reconstruction', not {self.goal!r}."
            )
        if usual is None:
            return None
        pitch = length("--scene-pitch", self.scene_pitch) or usual.pitch
        if self.scenes:
            return Scenes.of(_pictures(self.scenes), pitch, self.scene_samples)
        return Scenes(pitch, self.scene_samples)


def _pictures(paths: Sequence[Path] | None) -> "list[np.ndarray]":
    """Grey pictures of scenes."""
    from lumigraph.metrology.datasheet.planes import grey
    from lumigraph.preparation.given import read_raw

    return [grey(read_raw(one, "picture of a scene").data) for one in paths or ()]


@Parameter(name="*", group=section("Search"))
@dataclass(frozen=True)
class OptimiserOptions:
    """Search for the optimum.

    Parameters
    ----------
    search
        local: downhill from the best of the first values. global: over all of the ranges, by differential
        evolution. gradient: along derivatives, for bounds of microscopes and cameras, and errors of scenes
        of most of them; each step takes the time of some five cameras, however many keys vary.
        grid: the first values alone.
    evaluations
        Cameras at most, beyond the first values.
    seed
        Seed of --search global, and of the --trials.
    trials
        Raw images that are drawn with noise at each depth, before the camera as given and the best: points
        are fitted in them, or scenes reconstructed, and their errors stand beside what was expected. 0 for
        none; 200 are right for points, 8 for scenes.
    """

    search: Literal["local", "global", "gradient", "grid"] = "local"
    evaluations: Annotated[int, Parameter(allow_leading_hyphen=True)] = 200
    seed: Annotated[int, Parameter(allow_leading_hyphen=True)] = 0
    trials: Annotated[int, Parameter(allow_leading_hyphen=True)] = 0


def optimise(
    camera: str,
    /,
    *,
    vary: Annotated[list[str], Parameter(allow_leading_hyphen=True)],
    aim: GoalOptions = GoalOptions(),
    how: OptimiserOptions = OptimiserOptions(),
    output: Output,
    common: ReportOptions = REPORTED,
) -> Result:
    """Search for the best camera for a goal, within ranges and a stock, and write its file.

    All combinations of the first values are computed; then ranges are searched from the best of them. Safe
    to interrupt: run the same command again to resume; it finds the same camera.

    Example: `lumigraph optimise lfm-fourier --vary "fourier_lens=60 mm:110 mm:x3" --vary "lenslets.pitch=1 mm, 1.25 mm, 1.5 mm" --depth "-20 um:20 um:10 um" -o best.toml`

    Example: `lumigraph optimise camera.toml --vary "lenslets.magnification=0.2:0.6:x5" --goal "largest mtf@10/mm" -o best.toml --report best.html`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one.
    vary
        A key of the camera file and its values, as in 'lumigraph sweep': a range (first:last:step or first:last:xN), of which
        so many values are tried first; values separated by commas are a stock. Of a list such as a tilt, a
        number is the value's place: 'built.array_tilt.0=-2 mrad:2 mrad:x3'. May be repeated.
    output
        Camera file of the best (.toml).
    """  # noqa: E501 - an example is one line
    from lumigraph import store
    from lumigraph.instruments import load_camera
    from lumigraph.studies.optimisation import optimise as best_of

    common.check()
    files.check_output(output, (".toml",))
    given = load_camera(camera)
    goal = aim.read(given)
    with progress("optimise") as shown:
        found = best_of(
            given, vary, goal, against=aim.against, search=how.search, evaluations=how.evaluations,
            seed=how.seed, trials=how.trials, held_out=_pictures(aim.held_out), output=output, progress=shown,
            estimated=lambda seconds, count: line(_estimate(seconds, count)),
        )  # fmt: skip
    store.write_bytes(output, found.camera.to_toml().encode())
    return optimised.result(found, given, output)


def _estimate(seconds: float, count: int) -> str:
    from lumigraph.cluster.estimate import duration

    return f"{count} cameras to do at most: about {duration(seconds)}, if all take as long as the first"
