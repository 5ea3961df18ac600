"""Render in passes and stop early: when the picture no longer changes much, or when the time is up."""

import numpy as np

import lumipath as lp


def main(output="cornell.exr", width=400, spp=4096, noise=0.02, seconds=30.0):
    """Render until the noise is below `noise` of the mean radiance, at most `spp` samples and some `seconds`."""
    session = lp.Session(lp.builtin("cornell-box"), width=width, spp=spp)
    before = None
    looked_at = 0.0
    for progress in session:
        print(f"{progress.samples:g} of {progress.total} spp, {progress.mpaths_per_s:.2f} Mpaths/s")
        if progress.seconds > seconds:
            print("the time is up")
            break
        # Look at the picture whenever the number of samples has doubled: the change is about as large as its noise.
        if progress.samples >= 2 * looked_at:
            now = np.asarray(session.image())
            change = np.inf if before is None else np.sqrt(np.mean((now - before) ** 2)) / now.mean()
            before, looked_at = now, progress.samples
            if change < noise:
                print(f"the noise is about {100 * change:.1f} %: enough")
                break
    # The image of whatever there is; the passes could also go on from here.
    session.image().save(output)
    print(f"wrote {output}")


if __name__ == "__main__":
    main()
