"""The twelve claims of the talk, in its order."""

from __future__ import annotations

import difflib

from ssil_viewer.errors import UserError
from ssil_viewer.reproduce import light, sampling, speed, steady
from ssil_viewer.reproduce.claim import Claim

CLAIMS: tuple[Claim, ...] = (
    Claim("C1", "Cost does not depend on triangles or lights",
          "The cost of the indirect passes depends on the image alone and is constant in triangles and in lights.",
          "The Cornell box from more and more triangles and lights, the same picture each time; mipmapping, gather, "
          "upsampling and compositing, in rounds, the least of the rounds' tenth percentiles.",
          "The slowest point takes at most 5 % longer than the fastest, for triangles and for lights.",
          ("ssil-viewer bench --scaling --plots scaling.svg",), speed.constant_cost),
    Claim("C2", "The timing table, and less than 10 ms without visibility",
          "At 1280x720 on a GeForce GTX 260 the method takes about 10 ms a frame without visibility.",
          "The four rows of the talk's table with each kind of visibility, on the atrium, without glossy reflection.",
          "On a GPU, at 1280x720 or more: each of the four rows takes less than 10 ms without visibility. Software "
          "OpenGL cannot tell.",
          ("ssil-viewer bench builtin:atrium --glossy-samples 0 --json bench.json",), speed.timing_table),
    Claim("C3", "Visibility costs many times the gather, or twice",
          "With visibility by voxels the gather takes 16 to 22 times as long. (Ours with `horizon`: at most twice.)",
          "Time of the gather with `voxel` and with `horizon` over its time with `off`, in the talk's four rows.",
          "`horizon` takes at most 2 times the gather without visibility, in each of the four rows. The ratio of "
          "`voxel` is shown beside the talk's and not judged.",
          ("ssil-viewer bench builtin:atrium --glossy-samples 0 --sweep visibility=off,voxel,horizon",
           "ssil-viewer render builtin:arch -o arch.png --visibility horizon --show indirect --exposure 1.5"),
          speed.visibility_cost),
    Claim("C4", "One more level is nearly free, a larger radius is not",
          "A fifth level takes 7.85 ms in place of 7.8 ms; a larger radius costs more.",
          "Three ways to see twice as far: one more level; twice the radius; twice the radius with samples as close as "
          "before. Time of the gather, and noise of single frames over seeds.",
          "The fifth level adds at most 5 % to the gather, and twice the radius at the same spacing of samples at "
          "least 50 %.",
          ("ssil-viewer bench builtin:atrium --glossy-samples 0 --visibility off --sweep levels=4,5",
           "ssil-viewer bench builtin:atrium --glossy-samples 0 --visibility off --radius 96 --sweep samples=64,128"),
          speed.one_more_level),
    Claim("C5", "Few pixels with many samples beat many pixels with few",
          "At equal time a low starting resolution with many samples beats a high one with few.",
          "Single frames of the atrium without the temporal filter for a grid of starting levels and samples, as far "
          "reaching all; root mean square difference to R1, the sum over all texels of level 1, for every candidate "
          "the same.",
          f"Each candidate that starts at full resolution with at most {sampling.FEW_SAMPLES} samples is beaten by one "
          "that starts lower with more samples: no more time, less error.",
          ("ssil-viewer tune builtin:atrium --ms 50 --visibility off --json candidates.json",), sampling.equal_time),
    Claim("C6", "Voted mipmaps are steadier than nearest ones",
          "Keeping the most typical of four texels is steadier over time than keeping any.",
          "Mean change of a surface point's irradiance from frame to frame while the camera turns slowly, without the "
          "temporal filter; the point is followed by its motion vector.",
          "Voted mipmaps flicker at most 0.8 times as much as nearest ones, at every speed.",
          ("ssil-viewer render builtin:atrium -o vote.png --mip-filter vote --view normal@4",
           "ssil-viewer render builtin:atrium -o nearest.png --mip-filter nearest --view normal@4"), steady.voted_mips),
    Claim("C7", "The disc has the mean of the point, and less variance",
          "The point-to-disc form factor has the same mean as the point-to-point one and much less variance.",
          "The Cornell box in single frames with different seeds, samples even in area as in the talk; mean and "
          "variance of irradiance as shown, and the mean again with more samples.",
          f"With the most samples the means differ by at most {100 * sampling.SAME_MEAN:.0f} %, and with the fewest "
          f"the point form has at least {sampling.LESS_VARIANCE:g} times the variance of the disc.",
          ("ssil-viewer render builtin:cornell -o disc.png --sample-spacing area --form-factor disc --no-temporal "
           "--show indirect",
           "ssil-viewer render builtin:cornell -o point.png --sample-spacing area --form-factor point --no-temporal "
           "--show indirect"), sampling.form_factor),
    Claim("C8", "Importance sampling removes most variance of glossy reflection",
          "Samples where the lobe lies in the image remove most of the variance of glossy reflection.",
          "The floor of builtin:glossy, roughness 0.2, single frames without filters over seeds, with and without "
          "importance sampling, with as many samples.",
          "The variance with importance sampling is at most half of that without, and the means differ by at most 5 %.",
          ("ssil-viewer render builtin:glossy -o off.png --no-importance-sampling --no-temporal --show glossy",
           "ssil-viewer render builtin:glossy -o on.png --importance-sampling --no-temporal --show glossy"),
          sampling.importance_sampling),
    Claim("C9", "Hierarchical bilateral upsampling removes blocks and noise, and keeps edges",
          "Upsampling from level to level, across no edge, removes blocks and noise and keeps edges.",
          "The Cornell box, single frames without the temporal filter, with nearest and bilateral upsampling against "
          "R1: deviation within flat blocks of 8x8 pixels, and root mean square difference at edges.",
          "Bilateral upsampling leaves at most half of the noise of nearest in flat places, and its error at edges is "
          "not larger.",
          ("ssil-viewer render builtin:atrium -o nearest.png --camera hanging --upsampling nearest --no-temporal "
           "--show indirect",
           "ssil-viewer render builtin:atrium -o bilateral.png --camera hanging --no-temporal --show indirect"),
          steady.upsampling_quality),
    Claim("C10", "Reprojection removes almost all flicker at a low constant cost",
          "Reverse reprojection removes almost all flicker, at a low and constant cost.",
          "The flicker of C6 with and without the temporal filter, after its mean has settled; and the time of its "
          "pass under the same pan, in the talk's rows without voxels.",
          "At most a fifth of the flicker is left; the pass takes at most a tenth of the frame in every row, and in "
          "the slowest row at most 1.25 times as long as in the fastest.",
          ("ssil-viewer render builtin:atrium -o off.png --camera hanging --samples 8 --no-temporal --show indirect",
           "ssil-viewer render builtin:atrium -o on.png --camera hanging --samples 8 --show indirect"),
          steady.reprojection),
    Claim("C11", "More bounces by feeding the output back in",
          "Further bounces come from feeding the indirect light back in as input.",
          "The Cornell box with 0 to 4 bounces and with the last frame's light fed back: mean radiance of the image. "
          "Where Mitsuba is installed, also the error against all light of a path tracer.",
          "Each bounce brings light, less than the one before, and light fed back ends above two bounces; where there "
          "is a path tracer, the error falls from none to one and from one to four bounces.",
          ("ssil-viewer render builtin:cornell -o four.png --bounces 4",
           "ssil-viewer render builtin:cornell -o fed-back.png --feedback --frames 48",
           "ssil-viewer compare builtin:cornell --bounce-series"), light.more_bounces),
    Claim("C12", "Sponza: red pillars, and the relief comes out of the dark",
          "In Sponza the red of the curtains shows on the pillars, and the lion relief at the far end comes out of the "
          "dark.",
          "The built-in atrium: red over green of indirect light on stone, by distance to the nearest red cloth in the "
          "image; luminance of the relief in direct light alone and in both.",
          f"Within 0.5 m of the cloth red over green is at least {light.REDDER:g} times that beyond 1.5 m; direct "
          "light is at most a tenth of the relief's radiance, its picture reaches 5 % of the display's range on "
          "average, and varies by at least a tenth of that.",
          ("ssil-viewer render builtin:atrium -o hanging.png --camera hanging",
           "ssil-viewer render builtin:atrium -o relief.png --camera relief"), light.like_sponza),
)


def chosen(text: str | None) -> list[Claim]:
    """The claims that a flag names, in the talk's order; all of them without one.

    Args:
        text: Names with commas between them, in any case.

    Raises:
        UserError: There is no such claim; suggests the nearest.
    """
    if text is None:
        return list(CLAIMS)
    known = {claim.id: claim for claim in CLAIMS}
    every = ",".join(known)
    names = [word.strip().upper() for word in text.split(",") if word.strip()]
    if not names:
        raise UserError("no claim is named", "--claims", f"give some of {every}")
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name if name.startswith("C") else f"C{name}", known, 1)
            hint = f"did you mean {near[0]}?" if near else f"give some of {every}"
            raise UserError(f"no claim is called {name!r}", "--claims", hint)
    return [claim for claim in CLAIMS if claim.id in names]
