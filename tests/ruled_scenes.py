"""Scenes of a few dominoes with every kind of free sizes and of rules about them."""

import domino_env as de

BOX = de.Stock((0.005, 0.0075, 0.010), (3, 4, 2))
SPRINT = de.load_scene("sprint").replace(count=9, name="ruled")
MAGNIFY = de.load_scene("magnify").replace(count=7)
RULED = {
    "free": SPRINT.replace(thickness=(0.005, 0.01)),
    "thickness": SPRINT.replace(spacing=(0.018, 0.018), thickness=(0.005, 0.01)),
    "length": SPRINT.replace(length=0.18),
    "length-both": SPRINT.replace(length=0.18, thickness=(0.005, 0.01)),
    "stock": SPRINT.replace(stock=BOX),
    "stock-length": SPRINT.replace(stock=BOX, length=0.16),
    "stock-more": SPRINT.replace(stock=BOX.replace(count=(3, 5, 4))),
    "stock-order": SPRINT.replace(stock=BOX, spacing=(0.018, 0.018)),
    "growth": MAGNIFY,
    "growth-both": MAGNIFY.replace(thickness=(0.1, 0.2), objective="mean_speed"),
    "growth-fixed": MAGNIFY.replace(
        growth=(1.2, 1.2), thickness=(0.1, 0.2), objective="mean_speed"
    ),
}
