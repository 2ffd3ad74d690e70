"""Short scenes for the tests of environments, with every rule, objective and ground."""

import numpy as np
import pytest

import domino_env as de

SLOW = "jitter", "table", "tempo-noise"  # to find the uniform baseline takes long there


def short(name, count=7):
    """Return a scene with fewer dominoes, and less length in proportion."""
    scene = de.load_scene(name)
    length = scene.length and scene.length * (count - 1) / (scene.count - 1)
    scene = scene.replace(count=count, length=length)
    # any uniform layout serves
    return scene.with_uniform([0.021, 0.0075]) if name in SLOW else scene


SMALL = short("sprint").replace(name="small")


def play(env, policy, **reset):
    """Return actions, observations, rewards and the last info of one episode."""
    observation, info = env.reset(**reset)
    actions, observations, rewards, over = [], [observation], [], False
    while not over:
        assert set(info) <= {"scene"}
        actions.append(policy(len(actions)))
        observation, reward, over, truncated, info = env.step(actions[-1])
        observations.append(observation)
        rewards.append(reward)
        assert truncated is False
    return np.array(actions), np.array(observations), np.array(rewards), info


def gain_of(scene, score):
    """Return the gain as the page of the environment defines it."""
    uniform, free = scene.uniform().score, np.sqrt(scene.physics.gravity * scene.height)
    if scene.placement and scene.placement.quantile:  # episodes are single draws
        mean = scene.replace(placement=scene.placement.replace(quantile=None))
        uniform = mean.score(scene.uniform().layout)
    if scene.objective == "tempo":
        return 0.1 * np.log10(max(score, 1e-4) / uniform) + min(score, 0.0)
    if uniform > 0.0:
        return score / uniform - 1.0 if score > 0.0 else score - 1.0
    unit = {"m/s": free, "m": scene.height}.get(scene.unit, 1.0)
    return (score / unit if score > 0.0 else score) - uniform


def check_return(scene, rewards, score):
    """Check the sum of the rewards as the page of the environment defines it."""
    expected = 100.0 * gain_of(scene, score)
    if score <= 0.0 < scene.uniform().score:
        before = -100.0 if scene.objective == "magnify" else min(rewards[:-1].sum(), 0.0)
        expected = before + 10.0 * (score - 1.0)
        assert before - 20.0 <= expected <= before - 10.0
    assert rewards.sum() == pytest.approx(expected, abs=1e-9)


def size_of(entry, bounds, uniform):
    """Return the gap or thickness [m] of an entry of an action, by the formula of the page."""
    end = bounds[0] if entry < 0.0 else bounds[1]
    span, size = abs(np.log(end / uniform)), min(abs(entry), 1.0)
    logarithm = min(size * (1.0 + max(span - 1.0, 0.0) * size**2), span)
    return uniform * np.exp(np.sign(entry) * logarithm)


def scaled(scene, factor):
    """Return the scene with all lengths multiplied by a factor, and the same waves in its units."""
    physics = scene.physics.replace(push=scene.physics.push / np.sqrt(factor))
    sizes = {name: factor * getattr(scene, name) for name in ("height", "width", "first_thickness")}
    bounds = {name: factor * np.array(getattr(scene, name)) for name in ("spacing", "thickness")}
    return scene.replace(physics=physics, **sizes, **{k: tuple(v) for k, v in bounds.items()})


def courses():
    """Return scenes with a length: usual, hardly and not at all free, with free thicknesses."""
    course = de.load_scene("course")
    free = course.replace(thickness=(0.004, 0.012), first_thickness=0.0075)
    return {
        "course": course,
        "tight course": course.replace(length=59 * (0.0075 + 0.002) + 1e-4),
        "stretched course": course.replace(length=59 * (0.0075 + 0.040)),
        "free course": free,
        "thick course": free.replace(spacing=(0.01, 0.01)),
    }


def demanding():
    """Return scenes with every rule and objective beyond bounds, by name."""
    thick, gentle = short("sprint-thickness", 9), short("gentle", 6).replace(limits=None)
    jitter = de.load_scene("jitter")
    return {
        "box": short("stock", 9).replace(
            name="box", stock=de.Stock((0.01, 0.005, 0.0075), (3, 4, 2))
        ),
        "limits": thick.replace(limits=de.Limits(0.5)),
        "deadly limits": gentle.replace(limits=de.Limits(0.5)),
        "magnify": short("magnify", 8),
        "tempo": short("tempo", 8),
        "few draws": short("jitter", 8).replace(
            name="few draws", placement=jitter.placement.replace(draws=8)
        ),
        "two": short("sprint-thickness", 2),
        "three": gentle.replace(count=3),
    }


SCENES = {name: short(name, 12) for name in de.scene_names()} | demanding() | courses()
