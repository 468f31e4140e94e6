"""Compares an imported model with OpenSees, and writes its test file."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .. import Refused
from .frame import Frame
from .materials import Unfit
from .model import Model

# Largest difference between both programs, as a share of the largest value.
ALLOWED = 1e-6
# With P-Δ: the axial forces are those before a frame sways under its loads.
ALLOWED_P_DELTA = 1e-4
LEAST_RATE = 1000.0
DAMPERS = {"maxwell", "power_damper"}


def write(
    model: Model,
    frame: Frame,
    record: dict[str, Any],
    script: Path,
    out: Path,
    folder: Path,
    answered: Callable[[dict[str, Any], Path], dict[str, Any]],
) -> int:
    """Writes the test file and its records, if frequencies and displacements are those of OpenSees."""
    from ..._check import check
    from ..._errors import GussetError

    bare = folder / "bare.toml"
    bare.write_text(text(model, frame, script, [], None, loaded=False))
    try:
        found = check(bare)
    except GussetError as reason:
        raise Refused(f"gusset check refuses the imported model:\n{reason}") from None
    structure = found.data["structure"]
    places = structure["places"]
    massive = massive_places(model, frame)
    frequencies = structure["frequencies_rad_per_s"] or of_large(bare, next(place for place in places if place in massive))
    constant = list(model.constant.items())
    count = len(massive.intersection(places))
    question = {**record, "replaced": list(model.replaced), "constant": constant, "masses": count, "dofs": len(places)}
    told = answered(question, folder)
    compared = compare_frequencies(frequencies, [value / model.units.time for value in told["frequencies"]])
    loaded = bool(frame.loads)
    lines = [compared]
    if loaded:
        lines.append(compare_displacements(model, frame, script, told["moved"], places, folder))
    specimens = [specimen(model, frame, tag, places, told, massive) for tag in model.replaced]
    files = {}
    motions = []
    for number_, motion in enumerate(model.motions, 1):
        several = f"-{number_}-{motion['direction']}" if len(model.motions) > 1 else ""
        path = out.with_name(f"{out.stem}-ground{several}.csv")
        rows = (f"{i * motion['dt']!r},{value!r}" for i, value in enumerate(motion["values"]))
        files[path] = "\n".join(["time_s,accel_m_per_s2", *rows]) + "\n"
        motions.append((motion, path.name))
    files[out] = text(model, frame, script, specimens, motions, compared=lines)
    for path in files:
        if path.exists():
            raise Refused(f"{path} exists already; remove it, or choose another file with --out")
    whole = folder / "whole"
    whole.mkdir()
    for path, content in files.items():
        (whole / path.name).write_text(content)
    try:
        check(whole / out.name)
    except GussetError as reason:
        raise Refused(f"gusset check refuses the imported model:\n{reason}") from None
    out.parent.mkdir(parents=True, exist_ok=True)
    for path, content in files.items():
        path.write_text(content)
    print(f"{out} written. {' '.join(lines)}")
    for note in model.notes:
        print(f"note: {note}")
    print(f"Next: gusset check --verbose {out}")
    return 0


def massive_places(model: Model, frame: Frame) -> set[str]:
    """Degrees of freedom, such as "3 x", that have a mass at their node or at a node that follows it."""
    found = set()
    for tag in model.nodes:
        table = {} if tag in frame.gone else frame.masses(tag)
        tilts = table.get("tilting_mass_kg_m2", [0.0, 0.0])
        turns = {"rx": tilts[0], "ry": tilts[1], "rz": table.get("rotary_mass_kg_m2", 0.0)}
        for direction in model.directions:
            shifted = 0.0 if direction in table.get("massless", []) else table.get("mass_kg", 0.0)
            if turns.get(direction, shifted):
                found |= {f"{node} {along}" for node, along in frame.motion(tag, direction)}
    return found


def of_large(test: Path, place: str) -> list[float]:
    """The lowest frequencies of a large model, which `check` tells beside those of a reduced one."""
    from ..._check import check

    node, direction = place.rsplit(" ", 1)
    reduced = {"structure.reduce": {"modes": 12, "keep": [{"node": node, "direction": direction}]}}
    modes = check(test, set=reduced).data["structure"]["reduction"]["lowest_modes"]
    return [mode["frequency_rad_per_s"] for mode in modes]


def compare_frequencies(ours: list[float], theirs: list[float]) -> str:
    if not theirs:
        raise Refused("OpenSees finds no frequencies of the model, so it cannot be compared")
    worst = max(abs(a - b) / b for a, b in zip(ours, theirs))
    if worst > ALLOWED or len(ours) < len(theirs):
        table = ", ".join(f"{a:.6g} and {b:.6g}" for a, b in zip(ours, theirs))
        raise Refused(
            f"the imported model has other frequencies than OpenSees (rad/s, Gusset and OpenSees: {table}). Nothing is written. "
            "A mass, a stiffness or a constraint is understood differently; please report the script"
        )
    return f"{len(theirs)} frequencies agree with OpenSees to {max(worst, 1e-12):.0e}."


def compare_displacements(
    model: Model, frame: Frame, script: Path, theirs: dict[str, list[float]], places: list[str], folder: Path
) -> str:
    """Runs two steps without a motion: the first row stands under the constant loads."""
    from ... import open as open_run
    from ..._binary import binary

    test = folder / "loaded.toml"
    test.write_text(text(model, frame, script, [], None))
    command = [binary(), "run", str(test), "--out", str(folder / "loaded")]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise Refused(f"gusset run refuses the imported model under its constant loads:\n{done.stderr}")
    result = open_run(folder / "loaded")
    ours = result["disp"][0]
    pairs = []
    for place, value in zip(places, ours):
        name, direction = place.rsplit(" ", 1)
        index = model.directions.index(direction)
        unit = 1.0 if direction.startswith("r") else model.units.length
        pairs.append((direction.startswith("r"), float(value), theirs[name][index] * unit, place))
    worst, where = 0.0, ""
    moved = max((abs(pair[2]) for pair in pairs if not pair[0]), default=0.0)
    turned = max((abs(pair[2]) for pair in pairs if pair[0]), default=0.0)
    for turns, a, b, place in pairs:
        largest = max(turned, moved / frame.size()) if turns else moved
        share = abs(a - b) / largest if largest else 0.0
        if share > worst:
            worst, where = share, f"{place}: {a:.9g} and {b:.9g}"
    allowed = ALLOWED_P_DELTA if any(member.get("p_delta") for member in frame.members) else ALLOWED
    if worst > allowed:
        raise Refused(
            "under the constant loads the imported model moves otherwise than in OpenSees, solved to 1e-10 (Gusset and OpenSees, "
            f"{where}; "
            f"{worst:.1e} of the largest). Nothing is written"
        )
    return f"Displacements under the constant loads agree to {max(worst, 1e-12):.0e}."


def specimen(model: Model, frame: Frame, tag: int, places: list[str], told: dict[str, Any], massive: set[str]) -> dict[str, Any]:
    """The element as a specimen: its axes are its elongation and the rotations of its ends from the chord."""
    try:
        rows = frame.deformations(tag)
    except Unfit as reason:
        raise Refused(f"--replace {tag}: element {tag} {reason}") from None
    made = []
    for row in rows:
        numbers = [0.0] * len(places)
        for (node, direction), value in row.items():
            place = f"{node} {direction}"
            if abs(value) < 1e-15:
                continue
            if place not in massive:
                raise Refused(
                    f"--replace {tag}: {place} of element {tag} has no mass, so a measured force on it would be a step late. "
                    f"Give node {node} a mass in {direction} in the script"
                )
            numbers[places.index(place)] = value
        made.append(numbers)
    force, moment, length = model.units.force, model.units.force * model.units.length, model.units.length
    unit = [force, moment, moment]
    disp = [length, 1.0, 1.0]
    given = told["stiffness"][str(tag)]
    flat = [value for row in given for value in (row if isinstance(row, list) else [row])]
    stiffness = [[flat[3 * i + j] * unit[i] / disp[j] for j in range(3)] for i in range(3)]
    forces = [value * factor for value, factor in zip(told["forces"].get(str(tag), [0.0] * 3), unit)]
    kept = [i for i in range(3) if any(made[i])]
    if any(frame.stiffness_damping(beam) for beam in model.beams if beam.tag == tag):
        model.notes.append(f"The specimen in place of element {tag} is not damped by the rule.")
    return {
        "tag": tag,
        "name": model.replaced[tag],
        "rows": [made[i] for i in kept],
        "stiffness": [[stiffness[i][j] for j in kept] for i in kept],
        "forces": [forces[i] for i in kept],
        "names": [("elongation", "rotation of the start from the chord", "rotation of the end from the chord")[i] for i in kept],
    }


# ---- text ----


def number(value: float) -> str:
    """A number as TOML: the shortest one that is exact."""
    if value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return repr(value)


def inline(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return number(float(value))
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key(name)} = {inline(entry)}" for name, entry in value.items()) + " }"
    return "[" + ", ".join(inline(entry) for entry in value) + "]"


def key(name: str) -> str:
    return name if name.replace("-", "").replace("_", "").isalnum() else inline(name)


def text(
    model: Model,
    frame: Frame,
    script: Path,
    specimens: list[dict[str, Any]],
    motions: list[tuple[dict[str, Any], str]] | None,
    *,
    loaded: bool = True,
    compared: list[str] | None = None,
) -> str:
    """The test file. Without `motions` it is one of two steps, for the comparison."""
    own = motions is not None
    rate = rate_of(model)
    lines = []
    if own:
        lines += [
            f"# Imported from the OpenSees script {script.name}, whose units are {units(model)}. Units here are SI.",
            *(f"# {line}" for line in compared or []),
            "#",
            "#   gusset check --verbose FILE            # reads and rehearses the test, and lists the degrees of freedom",
            "#   gusset run FILE --out runs/first       # runs it; report.html shows the result",
            "#",
            "# Nodes and elements have their tags as names.",
        ]
        lines += [f"# {note}" for note in model.notes]
    lines += ["", f"title = {inline(script.stem)}", "", "[time]", f"rate_hz = {number(rate)}"]
    lines += [f"duration_s = {number(duration(model) if own else 2 / rate)}", 'clock = "simulated"', ""]
    tables = frame.tables(replaced=bool(specimens))
    if not loaded:
        tables.pop("load", None)
        # OpenSees counts no spring of a damper in a frequency.
        tables["link"] = [link for link in tables.get("link", []) if not DAMPERS & set(link["law"])]
    if frame.damping and own:
        lines += ["[structure.damping.rayleigh]", *(f"{name} = {inline(value)}" for name, value in frame.damping.items()), ""]
    if not own:
        for member in tables["member"]:
            member.pop("stiffness_coefficient_s", None)
        for link in tables.get("link", []):
            link.pop("damped", None)
    if frame.needs_lambda:
        lines += [
            "# A law without a bound of its stiffness: λ is given, and its stability is not proven.",
            "[integrator]",
            "lambda = 4",
            "",
        ]
    if own and any("corotational" in member for member in tables["member"]):
        lines.append("# Declare the rotations that you expect in `corotational`: smaller ones are more accurate.")
    lines.append("[structure.frame]")
    if "dimension" in tables:
        lines.append("dimension = 3")
    for name in ("node", "member", "link", "constraint", "load"):
        if tables.get(name):
            lines.append(f"{name} = [")
            for entry in tables[name]:
                comment = frame.comments.get(entry.get("name", "")) if name == "member" else None
                lines += [f"    # {comment}"] if comment and own else []
                lines.append(f"    {inline(entry)},")
            lines.append("]")
    for name in ("material", "section", "hinge"):
        for each, table in tables.get(name, {}).items():
            ((kind, of),) = table.items()
            if isinstance(of, list):
                lines += [
                    "",
                    f"[structure.frame.{name}.{key(each)}]",
                    f"{kind} = [",
                    *(f"    {inline(entry)}," for entry in of),
                    "]",
                ]
            else:
                lines += ["", f"[structure.frame.{name}.{key(each)}.{kind}]", *(f"{key(a)} = {inline(b)}" for a, b in of.items())]
    several = len(motions or []) > 1
    for motion, path in motions or []:
        lines += ["", "[[excitation.ground_acceleration]]" if several else "[excitation.ground_acceleration]"]
        if several or motion["direction"] != "x":
            lines.append(f'direction = "{motion["direction"]}"')
        lines += [
            f'signal.file = {{ path = {inline(path)}, column = {{ name = "accel_m_per_s2" }}, unit = "m/s^2" }}',
            "processing.zero_tail = true",
        ]
    for one in specimens:
        lines += of_specimen(one)
    return "\n".join(lines).lstrip("\n") + "\n"


def of_specimen(one: dict[str, Any]) -> list[str]:
    names = "; ".join(f"{number_} is the {name}" for number_, name in enumerate(one["names"], 1))
    forces = ", ".join(f"{value:.6g}" for value in one["forces"])
    return [
        "",
        f"# Element {one['tag']} of the script. Axis {names}: m and rad, N and N m.",
        "# Reports, columns and limits write m and N for all axes.",
        "# It is computed here by its initial stiffness in OpenSees.",
        "# For the physical specimen, replace `coupled` by a link, stiffness_n_per_m and limits (guide, real-specimen).",
        f"# Under the constant loads OpenSees finds the forces {forces}.",
        "[[specimen]]",
        f'name = "{one["name"]}"',
        "rows = [",
        *(f"    {inline(row)}," for row in one["rows"]),
        "]",
        "coupled.stiffness_n_per_m = [",
        *(f"    {inline(row)}," for row in one["stiffness"]),
        "]",
    ]


def units(model: Model) -> str:
    return f"{model.units.force:g} N, {model.units.length:g} m and {model.units.time:g} s"


def rate_of(model: Model) -> float:
    """A multiple of the rate of the record, at least 1000 Hz."""
    steps = [motion["dt"] for motion in model.motions]
    for dt in steps[:1]:
        own = 1 / dt
        if abs(own - round(own)) < 1e-6 * own:
            own = float(round(own))
            return own * max(1, -(-LEAST_RATE // own))
    return 1024.0


def duration(model: Model) -> float:
    wanted = float(max(motion["dt"] * len(motion["values"]) for motion in model.motions))
    if model.duration:
        wanted = max(wanted, model.duration)
    return max(round(wanted * rate_of(model)), 2) / rate_of(model)
