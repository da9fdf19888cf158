"""Write docs/parameters.md from what the core says of its numbers."""

from collections.abc import Iterable
from pathlib import Path

from pellucid.controllers.control_law import LAWS
from pellucid.models.fields import Field, model_fields

MODELS = {
    "joint": "A joint, as identification finds it",
    "presliding": "Friction below slip",
    "geared_joint": "A motor and a link behind a compliant transmission",
    "coupled_plant": "A series-elastic orthosis, its strap and the limb in it",
    "reaching": "A person who reaches",
    "postural": "A person who reaches and then holds",
    "optimal": "A person who reaches by optimal feedback",
    "link": "A link of a tree, and the joint by which it hangs",
    "cuff": "A cuff between a robot's link and a limb's",
    "posture_servo": "Muscles that follow a motion, and their reflex",
    "muscle": "A muscle from its EMG envelope on",
    "emg_channel": "A channel of EMG of the estimator of torque",
    "watched_channel": "A channel as it was in the calibration",
    "watched_angle": "Range of an angle in the calibration",
    "estimated_joint": "A joint that it gives a torque of, beside its muscles",
    "short_range": "Stiffness of a muscle at once",
    "strap_estimator": "A strap learnt while it is worn",
    "tree_law_joint": "What a law of several joints does at each",
    "tree_law_whole": "And with all",
    "tree_watch_joint": "What its supervisor watches of each joint",
    "tree_watch_whole": "And of all",
}
OUT = Path(__file__).parents[1] / "docs" / "parameters.md"


def table(fields: Iterable[Field]) -> str:
    rows = [
        f"| `{f.name}` | {f.unit()} | {f.default:g} | {f.range} | {f.sentence.replace('|', chr(92) + '|')} |"
        for f in fields
    ]
    return "\n".join(["| name | unit | default | range | |", "|---|---|---|---|---|", *rows])


def text() -> str:
    gate = {f.name for f in model_fields("gate")}
    parts = [
        "# Parameters\n\nMade by `python bindings/write_parameters.py` from the core's headers. Units are those of a "
        "rotary joint whose efforts are torques: on a slide N m, rad and kg m^2 are N, m and kg. A default of 0 must "
        "often be set."
    ]
    parts += [f"## {title}\n\n{table(model_fields(name))}" for name, title in MODELS.items()]
    parts.append(f"## The safety gate, with which every law ends\n\n{table(model_fields('gate'))}")
    parts.append(
        f"## The supervisor, which the lab and exports put around every law\n\n{table(model_fields('supervisor'))}"
    )
    for law in LAWS.values():
        reads = ", ".join(f"`{s.name}` [{s.unit()}]{'' if s.required else ' (optional)'}" for s in law.sensors)
        title = law.title[0].upper() + law.title[1:]
        own = table(f for f in law.fields if f.name not in gate)
        parts.append(f"## `{law.name}`: {title}\n\nReads {reads}. Then the gate's.\n\n{own}")
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    OUT.write_text(text(), encoding="utf-8")
