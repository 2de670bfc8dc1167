"""Jobs on a Ray cluster: datasets, banks, chains, and the trade of speed for accuracy.

    import pcadlang.ray

    pcadlang.ray.evaluate("lathe.pcad", "data/objects", out="results", steps=2000)

Results are those of one machine, bit for bit, if their length is set by steps and not by time.
See `docs/howto/cluster.md` of the project.
"""

from pcadlang.ray.chains import Chain, Chains
from pcadlang.ray.evaluate import evaluate
from pcadlang.ray.jobs import Lost, Progress
from pcadlang.ray.learn import learn
from pcadlang.ray.sample import Recipe, sample
from pcadlang.ray.tradeoff import tradeoff

__all__ = [
    "Chain",
    "Chains",
    "Lost",
    "Progress",
    "Recipe",
    "evaluate",
    "learn",
    "sample",
    "tradeoff",
]
