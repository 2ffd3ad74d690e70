"""The thickness that a policy for equal dominoes says, fitted to searched rows.

python -m agents.lab.thickness_head --policy RUN --out FOLDER [--examples 52]

The hidden layers, the gaps and the plans stay as they are: only the last layer's weights of the
thickness are solved for, by regression with a ridge. `auto` searches rows of `varied-thickness` for
it, some half a minute of one core. A value beyond a bound is cut off, so that it is as good as one
at the bound: targets there move along, for a few rounds.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.base.network import Network
from agents.base.run_files import CONFIG, POLICY
from agents.conditioned.features import features_of
from agents.conditioned.observations import observations, plans_of
from agents.conditioned.policy import ALGORITHM, ConditionedPolicy
from agents.conditioned.scenes import Pools
from agents.dataset.rows import search_rows
from agents.evaluation.one_scene import folder_of
from domino_env.core.files import write_bytes, write_text
from optimize.studies.task import TaskResult

Floats = NDArray[np.float64]

KIND, EVALUATIONS = "varied-thickness", 600
RIDGE, ROUNDS, BEYOND = 1.0, 60, 0.5


def fitted(policy: ConditionedPolicy, rows: list[TaskResult]) -> ConditionedPolicy:
    """Fit the thickness to rows of the first scenes of the pool, and keep all else.

    Parameters
    ----------
    policy
        Whose hidden layers are used.
    rows
        Searched rows of the first scenes of the pool of `varied-thickness`.
    """
    pools, inputs, wanted, reach = Pools([KIND]), list[Floats](), list[Floats](), list[Floats]()
    for i, row in enumerate(rows):
        scene = pools[i]
        features, gaps = features_of(scene), row.spacing / scene.height
        tight = int(np.cumprod(gaps[::-1] <= features[3] * (1.0 + 1e-6)).sum())
        plan = min(tight, plans_of(scene.count) - 1)
        values = observations(features, np.array([float(plan)])).astype(np.float32)
        for weight, bias in policy.row.layers[:-1]:
            values = np.tanh(values @ weight.T + bias)
        inputs.append(np.c_[values.astype(np.float64), np.ones(len(values))])
        middle = scene.height * np.sqrt(features[6] * features[7])
        wanted.append(np.log(row.thickness[1:] / middle))
        reach.append(np.full(len(gaps), 0.5 * np.log(features[7] / features[6])))
    a, y, half = (np.concatenate(parts) for parts in (inputs, wanted, reach))
    weights: Floats = np.zeros(a.shape[1])
    goal = y.copy()
    for _ in range(ROUNDS):
        weights = np.asarray(np.linalg.solve(a.T @ a + RIDGE * np.eye(a.shape[1]), a.T @ goal))
        says = a @ weights
        thick, thin = (y >= half - 1e-6) & (says > half), (y <= -half + 1e-6) & (says < -half)
        goal = np.where(thick, np.minimum(says, half + BEYOND), y)
        goal = np.where(thin, np.maximum(says, -half - BEYOND), goal)
    weight, bias = (array.copy() for array in policy.row.layers[-1])
    weight[1], bias[1] = weights[:-1], weights[-1]
    return ConditionedPolicy(Network((*policy.row.layers[:-1], (weight, bias))), policy.plan)


def main() -> None:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--policy", default="designer", help="a run's folder, or designer")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--examples", type=int, default=52)
    arguments = parser.parse_args()
    scenes = [Pools([KIND])[i] for i in range(arguments.examples)]
    arguments.out.mkdir(parents=True, exist_ok=True)
    store = arguments.out / "examples.sqlite"
    rows = search_rows(scenes, EVALUATIONS, 0, store, {"pool": KIND}, progress=None)
    made = fitted(ConditionedPolicy.load(folder_of(arguments.policy)), rows).arrays()
    write_bytes(
        arguments.out / POLICY, lambda file: np.savez_compressed(file, allow_pickle=False, **made)
    )
    write_text(arguments.out / CONFIG, json.dumps({"algorithm": ALGORITHM}) + "\n")


if __name__ == "__main__":
    main()
