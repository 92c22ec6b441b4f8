# %% [markdown]
# # Gap and speed of a recorded drive
#
# Reads a recording of the automated driving system in `ads/`, and plots how fast the vehicle drove and how much room
# there was to the vehicle ahead of it. It runs as a script, and cell by cell in editors that know `# %%`.
#
#     fastcycle run ads/ads.json --clock simulated
#     python3 plot_drive.py recording.mcap drive.png

# %%
import sys

import numpy
import pandas

import fastcycle

arguments = [word for word in sys.argv[1:] if word.endswith((".mcap", ".png"))]
LOG, PICTURE = (arguments + ["recording.mcap", "drive.png"][len(arguments) :])[:2]

# %% [markdown]
# ## What is in it

# %%
log = fastcycle.Log(LOG)
print(f"{LOG}: {log.duration:.1f} s, {len(log.topics)} topics")
for topic in log.topics.values():
    print(f"  {topic.name:28} {topic.count:6}  {topic.type}")

# %% [markdown]
# ## Speed
#
# Fields that have one value in each message are columns of a table. Only their bytes are read.

# %%
ego = log.frame("localization/ego", ["speed_mps", "acceleration_mps2", "quality"])
print(ego.describe())

# %% [markdown]
# ## Gap
#
# A scene has any number of objects, so its messages are looked at one by one. `gap_m` is the distance along the route
# from bumper to bumper, here to the vehicle that drives ahead on the lane. Where there is none, there is no gap.


# %%
def leading_gap_m(scene) -> float:
    """The gap to the vehicle ahead on the lane, in metres; NaN without one."""
    leading = scene.DESCRIPTOR.file.enum_types_by_name["Relation"].values_by_name["LEADING"].number
    return min((one.gap_m for one in scene.objects if one.relation == leading), default=numpy.nan)


scenes = [(scene.time, leading_gap_m(scene.message)) for scene in log["scene/scene"]]
gap = pandas.Series(
    [gap_m for _, gap_m in scenes],
    index=pandas.DatetimeIndex([time for time, _ in scenes], tz="UTC"),
)
print(f"speed: {ego.speed_mps.min():.1f} to {ego.speed_mps.max():.1f} m/s")
print(f"smallest gap: {gap.min():.2f} m" if gap.notna().any() else "smallest gap: nothing was ahead")

# %% [markdown]
# ## Both over time

# %%
try:
    import matplotlib
except ModuleNotFoundError:
    sys.exit("There is no picture without Matplotlib: apt-get install python3-matplotlib")

if not hasattr(sys, "ps1"):
    matplotlib.use("Agg")  # A script needs no screen.
from matplotlib import pyplot  # noqa: E402

start = pandas.Timestamp(log.start, tz="UTC")
figure, (above, below) = pyplot.subplots(2, sharex=True, figsize=(9, 5))
above.plot((ego.index - start).total_seconds(), ego.speed_mps)
above.set_ylabel("speed (m/s)")
below.plot((gap.index - start).total_seconds(), gap)
below.set_ylabel("gap to the vehicle ahead (m)")
below.set_xlabel("time (s)")
for axes in (above, below):
    axes.set_ylim(bottom=0)
    axes.grid(True)
figure.tight_layout()
figure.savefig(PICTURE)
print(f"{PICTURE} has the curves")
