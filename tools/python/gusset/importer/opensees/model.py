"""From the recorded commands of OpenSees to the tables of a frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from ..units import Units
from . import materials, sections
from .materials import Unfit

PLANE = ("x", "y", "rz")
SPACE = ("x", "y", "z", "rx", "ry", "rz")
# They change nothing in the model, or only how OpenSees solves it.
IGNORED = {
    "wipe", "wipeAnalysis", "constraints", "numberer", "system", "test", "algorithm", "integrator", "analysis", "eigen",
    "recorder", "record", "printModel", "printA", "printB", "printGID", "print", "logFile", "database", "save", "setPrecision",
    "display", "setTime", "start", "stop", "modalProperties", "numFact", "numIter", "version", "reactions", "setMaxOpenFiles",
    "initialize", "setNumThreads", "responseSpectrumAnalysis",
}  # fmt: skip
QUERIES = ("node", "ele", "get", "basic", "section", "test", "retain", "peer", "convert", "load")


@dataclass
class Mistake:
    """A command without counterpart."""

    place: tuple[str, int]
    text: str

    def __str__(self) -> str:
        return f"{self.place[0]}:{self.place[1]}: {self.text}" if self.place[0] else self.text


@dataclass
class Beam:
    """An element of OpenSees between two nodes."""

    tag: int
    kind: str
    nodes: list[int]
    place: tuple[str, int]
    turned: Any = None
    table: dict[str, Any] = field(default_factory=dict)
    mass: float = 0.0
    elastic: bool = False
    damped: bool = True

    def turned_from(self, model: Model) -> str:
        """Kind of its transformation."""
        return str(model.turns.get(self.turned, ["Linear"])[0])


@dataclass
class Spring:
    """One direction of a zero-length element or a link."""

    tag: int
    nodes: list[int]
    direction: str
    material: Any
    place: tuple[str, int]
    damped: bool = False


class Model:
    """The model that the commands of a script build."""

    def __init__(self, record: dict[str, Any], units: Units, replaced: dict[int, str], accept_damping: bool) -> None:
        self.units, self.replaced, self.accept_damping = units, replaced, accept_damping
        self.mistakes: list[Mistake] = []
        self.notes: list[str] = []
        self.directions: tuple[str, ...] = PLANE
        self.ndm, self.ndf = 2, 3
        self.nodes: dict[int, list[float]] = {}
        self.fixed: dict[int, set[str]] = {}
        self.mass: dict[int, list[float]] = {}
        self.materials: dict[Any, list[Any]] = {}
        self.sections: dict[Any, dict[str, Any]] = {}
        self.turns: dict[Any, list[Any]] = {}
        self.integrations: dict[Any, list[Any]] = {}
        self.beams: list[Beam] = []
        self.springs: list[Spring] = []
        self.equal: dict[tuple[int, tuple[str, ...]], list[int]] = {}
        self.rigid: dict[int, list[int]] = {}
        self.floors: dict[int, list[int]] = {}
        self.series: dict[Any, list[Any]] = {}
        self.files: dict[Any, dict[str, Any]] = {}
        self.patterns: dict[Any, dict[str, Any]] = {}
        self.constant: dict[Any, float] = {}
        self.motions: list[dict[str, Any]] = []
        # Coefficients of nodes for their mass, and of elements for their mass and stiffness.
        self.node_damping: dict[int, float] = {}
        self.element_damping: dict[int, tuple[float, float]] = {}
        self.duration: float | None = None
        self.used: dict[str, dict[Any, str]] = {"material": {}, "section": {}, "hinge": {}}
        self.tables: dict[str, dict[str, Any]] = {"material": {}, "section": {}, "hinge": {}}
        self.section_now: dict[str, Any] | None = None
        self.pattern_now: dict[str, Any] | None = None
        self.read(record)

    def read(self, record: dict[str, Any]) -> None:
        held = False
        for one in record["commands"]:
            name, args = one["name"], one["args"]
            self.place = tuple(one["place"])
            try:
                if name == "loadConst":
                    held = True
                    if self.motions:
                        self.refuse("stops the ground motion that stands before it: put the pattern UniformExcitation after it")
                    self.constant.update({tag: factor for tag, factor in one["factors"]})
                elif name == "analyze":
                    self.analyze(one, args)
                elif hasattr(self, f"do_{name}"):
                    if "file" in one:
                        self.files[args[1]] = one["file"]
                    getattr(self, f"do_{name}")(*args)
                elif name not in IGNORED and not name.startswith(QUERIES):
                    self.refuse(f"the command `{name}` has no counterpart in Gusset")
            except Unfit as reason:
                self.refuse(f"`{' '.join([name, *map(str, args[:2])])}` {reason}")
            except (TypeError, ValueError, IndexError, KeyError) as reason:
                self.refuse(f"`{name} {' '.join(map(str, args))}` is not understood ({type(reason).__name__}: {reason})")
        self.begin(record, held)

    def begin(self, record: dict[str, Any], held: bool) -> None:
        """The loads and the time with which the transient analysis begins."""
        for tag, factor in record["factors"]:
            pattern = self.patterns.get(tag)
            if not pattern or not (pattern["loads"] or pattern["beams"]):
                continue
            self.place = pattern["place"]
            if tag not in self.constant and self.series.get(pattern["series"], [""])[0] == "Constant":
                self.constant[tag] = factor
            if tag not in self.constant:
                why = "follow `loadConst`" if held else "are not held: no `loadConst` stands before the transient analysis"
                self.refuse(f"the loads of pattern {tag} {why}, so they change in the transient analysis, which has no counterpart")
            elif not pattern["analyzed"]:
                self.refuse(f"no static analysis follows pattern {tag}: loads that act suddenly have no counterpart")
            elif pattern["unloaded"] and not self.is_linear():
                self.refuse(f"pattern {tag} was larger before: the state after unloading has no counterpart")
        self.place = tuple(record["commands"][-1]["place"]) if record["commands"] else ("", 0)
        if not self.motions:
            self.refuse("no `pattern UniformExcitation` stands before the transient analysis")
        elif abs(record["time"]) > 1e-9:
            self.refuse(f"the transient analysis begins at the time {record['time']:g}: begin it at 0, with `loadConst -time 0.0`")

    def refuse(self, text: str) -> None:
        if all(text != known.text for known in self.mistakes):
            self.mistakes.append(Mistake(self.place, text))

    # ---- model ----

    def do_model(self, _kind: str, *rest: Any) -> None:
        given = dict(zip(rest[::2], rest[1::2]))
        self.ndm = int(given["-ndm"])
        ndf = int(given.get("-ndf", {1: 1, 2: 3, 3: 6}[self.ndm]))
        if (self.ndm, ndf) not in ((2, 3), (3, 6), (2, 2), (3, 3)):
            raise Unfit(f"has {ndf} degrees of freedom at a node in {self.ndm} dimensions; 3 in a plane and 6 in space are known")
        self.ndf = ndf
        self.directions = PLANE if self.ndm == 2 else SPACE

    def given_directions(self) -> tuple[str, ...]:
        return self.directions if self.ndf in (3, 6) and (self.ndm, self.ndf) != (3, 3) else self.directions[: self.ndm]

    def do_node(self, tag: int, *rest: Any) -> None:
        at = [float(value) for value in rest[: self.ndm]]
        self.nodes[tag] = [value * self.units.length for value in at]
        more = list(rest[self.ndm :])
        if more[:1] == ["-mass"]:
            self.do_mass(tag, *more[1 : 1 + self.ndf])
            more = more[1 + self.ndf :]
        if more:
            raise Unfit(f"has the option {more[0]}, which has no counterpart")
        if len(self.given_directions()) < len(self.directions):
            self.fixed.setdefault(tag, set()).update(self.directions[self.ndm :])

    def do_fix(self, tag: int, *flags: Any) -> None:
        held = (name for name, flag in zip(self.given_directions(), flags) if int(flag))
        self.fixed.setdefault(tag, set()).update(held)

    def fix_at(self, axis: int, at: float, *flags: Any) -> None:
        tolerance = 1e-10
        if "-tol" in flags:
            tolerance = float(flags[flags.index("-tol") + 1])
            flags = flags[: flags.index("-tol")]
        for tag, place in self.nodes.items():
            if abs(place[axis] / self.units.length - at) < tolerance:
                self.do_fix(tag, *flags)

    def do_fixX(self, at: float, *flags: Any) -> None:
        self.fix_at(0, at, *flags)

    def do_fixY(self, at: float, *flags: Any) -> None:
        self.fix_at(1, at, *flags)

    def do_fixZ(self, at: float, *flags: Any) -> None:
        self.fix_at(2, at, *flags)

    def do_mass(self, tag: int, *values: float) -> None:
        known = self.mass.setdefault(tag, [0.0] * len(self.directions))
        for i, (name, value) in enumerate(zip(self.given_directions(), values)):
            unit = self.units.mass * (self.units.length**2 if name.startswith("r") else 1.0)
            known[i] = float(value) * unit

    def add_mass(self, tag: int, mass: float) -> None:
        known = self.mass.setdefault(tag, [0.0] * len(self.directions))
        for i in range(self.ndm):
            known[i] += mass

    def do_equalDOF(self, master: int, node: int, *numbers: int) -> None:
        along = tuple(self.given_directions()[int(number) - 1] for number in numbers)
        self.equal.setdefault((master, along), []).append(node)

    def do_rigidLink(self, kind: str, master: int, node: int) -> None:
        if kind in ("beam", "-beam"):
            self.rigid.setdefault(master, []).append(node)
        else:
            self.equal.setdefault((master, self.directions[: self.ndm]), []).append(node)

    def do_rigidDiaphragm(self, normal: int, master: int, *nodes: int) -> None:
        if self.ndm == 3 and normal == 3:
            self.floors.setdefault(master, []).extend(nodes)
        elif self.ndm == 2:
            self.equal.setdefault((master, ("x",)), []).extend(nodes)
        else:
            raise Unfit("is not horizontal: its normal must be 3, and z points upwards")

    # ---- materials, sections, geometry ----

    def do_uniaxialMaterial(self, kind: str, tag: Any, *rest: Any) -> None:
        self.materials[tag] = [kind, tag, *rest]

    def do_nDMaterial(self, kind: str, tag: Any, *_: Any) -> None:
        raise Unfit("has no counterpart: only uniaxial materials are known")

    def do_frictionModel(self, *_: Any) -> None:
        raise Unfit("has no counterpart: write the bearing into the test file by hand (guide, devices)")

    def do_section(self, kind: str, tag: Any, *rest: Any) -> None:
        made: dict[str, Any] = {"kind": kind, "place": self.place, "fibres": [], "torsion": None}
        numbers = [value for value in rest if not isinstance(value, str)]
        if kind == "Elastic":
            made["numbers"] = [float(value) for value in numbers]
            if len(numbers) > (6 if self.ndm == 3 else 3):
                raise Unfit("has a shear stiffness, which a member does not have")
        elif kind == "Fiber":
            if "-noCentroid" in rest:
                raise Unfit("has the option -noCentroid, which has no counterpart")
            if "-GJ" in rest:
                made["torsion"] = float(rest[rest.index("-GJ") + 1])
            elif "-torsion" in rest:
                made["torsion"] = self.elastic_stiffness(rest[rest.index("-torsion") + 1])
        elif kind == "WFSection2d":
            material, depth, web, width, flange, of_web, of_flange = rest[:7]
            clear = float(depth) - 2 * float(flange)
            for y in (-1, 1):
                edges = sorted((y * clear / 2, y * float(depth) / 2))
                args = ["rect", material, of_flange, 1, edges[0], -width / 2, edges[1], width / 2]
                made["fibres"] += sections.fibres(args, "patch")
            made["fibres"] += sections.fibres(["rect", material, of_web, 1, -clear / 2, -web / 2, clear / 2, web / 2], "patch")
        elif kind == "Aggregator":
            place = rest.index("-section") if "-section" in rest else len(rest)
            pairs = list(zip(rest[:place:2], rest[1:place:2]))
            if place == len(rest) or any(code != "T" for _, code in pairs):
                raise Unfit("adds more than torsion to a section, which has no counterpart")
            made = {**self.sections[rest[place + 1]], "torsion": self.elastic_stiffness(pairs[0][0])}
        else:
            raise Unfit("has no counterpart: Elastic, Fiber, WFSection2d and Aggregator with torsion are known")
        self.sections[tag] = made
        self.section_now = made

    def elastic_stiffness(self, tag: Any) -> float:
        kind, _, *numbers = self.materials[tag]
        if kind != "Elastic":
            raise Unfit("has a torsion that is not elastic")
        return float(numbers[0])

    def fibre(self, name: str, args: tuple[Any, ...]) -> None:
        if self.section_now is None:
            raise Unfit("stands outside of a section")
        self.section_now["fibres"] += sections.fibres(list(args), name)

    def do_fiber(self, *args: Any) -> None:
        self.fibre("fiber", args)

    def do_patch(self, *args: Any) -> None:
        self.fibre("patch", args)

    def do_layer(self, *args: Any) -> None:
        self.fibre("layer", args)

    def do_geomTransf(self, kind: str, tag: Any, *rest: Any) -> None:
        if kind not in ("Linear", "PDelta", "Corotational"):
            raise Unfit("has no counterpart: Linear, PDelta and Corotational are known")
        self.turns[tag] = [kind, *rest]

    def do_beamIntegration(self, kind: str, tag: Any, *rest: Any) -> None:
        self.integrations[tag] = [kind, *rest]

    # ---- elements ----

    def do_element(self, kind: str, tag: int, *args: Any) -> None:
        own = getattr(self, f"element_{kind}", None)
        if own is None:
            raise Unfit("has no counterpart")
        own(tag, list(args))

    def split(self, args: list[Any]) -> tuple[list[Any], dict[str, list[Any]]]:
        """Numbers before the options, and what follows each option."""
        front: list[Any] = []
        options: dict[str, list[Any]] = {}
        now = front
        for value in args:
            if isinstance(value, str) and value.startswith("-") and not is_number(value):
                now = options.setdefault(value, [])
            else:
                now.append(value)
        return front, options

    def only(self, options: dict[str, list[Any]], *known: str) -> None:
        for option in options:
            if option not in known:
                raise Unfit(f"has the option {option}, which has no counterpart")

    def beam(self, tag: int, kind: str, nodes: list[int], turned: Any, options: dict[str, list[Any]]) -> Beam:
        made = Beam(tag, kind, [int(node) for node in nodes], self.place, turned)
        if "-mass" in options:
            made.mass = float(options["-mass"][0])
        if "-cMass" in options and made.mass:
            raise Unfit("has a consistent mass; Gusset knows lumped masses: leave out -cMass")
        self.beams.append(made)
        return made

    def element_elasticBeamColumn(self, tag: int, args: list[Any]) -> None:
        front, options = self.split(args)
        self.only(options, "-mass", "-cMass", "-release", "-releasez", "-releasey")
        nodes, rest = front[:2], front[2:]
        if len(rest) == 2:
            section = self.sections[rest[0]]
            if section["kind"] != "Elastic":
                raise Unfit("has a section that is not Elastic")
            numbers = section["numbers"]
        else:
            a, e, *more = (float(value) for value in rest[:-1])
            if self.ndm == 3:
                g, j, iy, iz = more
                numbers = [e, a, iz, iy, g, j]
            else:
                numbers = [e, a, more[0]]
        made = self.beam(tag, "elastic", nodes, rest[-1], options)
        made.elastic = True
        made.table["section"] = self.elastic_section(numbers)
        codes = {int(options[key][0]) for key in ("-release", "-releasez", "-releasey") if key in options}
        if len(codes) > 1 or (self.ndm == 3 and codes and not {"-releasez", "-releasey"} <= set(options)):
            raise Unfit("releases one of its two bendings, which has no counterpart")
        if codes - {0}:
            made.table["release"] = {1: ["start"], 2: ["end"], 3: ["start", "end"]}[codes.pop()]

    def elastic_section(self, numbers: list[float]) -> str:
        force, length = self.units.force, self.units.length
        young, area, strong = numbers[0] * force / length**2, numbers[1] * length**2, numbers[2] * length**4
        made = {"young_pa": young, "area_m2": area, "inertia_m4": strong}
        if self.ndm == 3:
            weak, shear, torsion = numbers[3:6]
            # G is E/2.6 here.
            made.update({"weak_inertia_m4": weak * length**4, "torsion_m4": torsion * length**4 * shear * 2.6 / numbers[0]})
        return self.named("section", tuple(numbers), "elastic", {"elastic": made})

    def named(self, list_: str, key: Any, stem: str, table: dict[str, Any]) -> str:
        """Name of a table that is written once."""
        known = self.used[list_]
        if key not in known:
            name, count = stem, 1
            while name in self.tables[list_]:
                count += 1
                name = f"{stem}-{count}"
            known[key] = name
            self.tables[list_][name] = table
        return known[key]

    def material_named(self, tag: Any) -> str:
        if tag not in self.materials:
            raise Unfit(f"has the unknown material {tag}")
        args = self.materials[tag]
        try:
            return self.named("material", tag, f"material-{tag}", materials.of_fibres(args, self.units))
        except Unfit as reason:
            raise Unfit(f"has the material {args[0]} {tag}, which {reason}") from None

    def fibre_section(self, tag: Any) -> str:
        """A section of fibres, for its members."""
        section = self.sections[tag]
        if section["kind"] == "Elastic":
            return self.elastic_section(section["numbers"])
        length = self.units.length
        if not section["fibres"]:
            raise Unfit(f"has the section {tag}, which has no fibres")
        made = []
        for y, z, area, material in sections.centred(section["fibres"], self.ndm == 3):
            one = {"y_m": y * length, "area_m2": area * length**2, "material": self.material_named(material)}
            if self.ndm == 3:
                one["z_m"] = z * length
            made.append(one)
        return self.named("section", ("fibres", tag), f"section-{tag}", {"fibres": made})

    def fibre_beam(self, tag: int, args: list[Any], kind: str, rule: str) -> None:
        front, options = self.split(args)
        self.only(options, "-mass", "-cMass", "-iter")
        if len(front) == 5:
            # The old form has points, section and transformation.
            first, last, points, section_tag, turned = front
            of, rest = rule, [section_tag, points]
        else:
            first, last, turned, number = front[:4]
            of, *rest = self.integrations[number]
        if of != rule:
            raise Unfit(f"has the integration {of}; with this element only {rule} is known")
        if len(rest) != 2:
            raise Unfit("has several sections; one section for the whole element is known")
        made = self.beam(tag, kind, [first, last], turned, options)
        section = self.sections[rest[0]]
        made.table["section"] = self.fibre_section(rest[0])
        if section["kind"] == "Elastic":
            if rule == "Lobatto" and int(rest[1]) < 3:
                raise Unfit("has an elastic section and two points, which do not bend as an elastic member: use three")
            made.kind, made.elastic = "elastic", True
            return
        made.table["points"] = int(rest[1])
        if self.ndm == 3:
            if section["torsion"] is None:
                raise Unfit("has a section without torsion")
            made.table["torsion_n_m2"] = section["torsion"] * self.units.force * self.units.length**2

    def element_forceBeamColumn(self, tag: int, args: list[Any]) -> None:
        self.fibre_beam(tag, args, "force_based", "Lobatto")

    def element_dispBeamColumn(self, tag: int, args: list[Any]) -> None:
        self.fibre_beam(tag, args, "displacement_based", "Legendre")

    element_nonlinearBeamColumn = element_forceBeamColumn

    def element_Truss(self, tag: int, args: list[Any]) -> None:
        front, options = self.split(args)
        self.only(options, "-rho", "-cMass", "-doRayleigh")
        first, last, area, material = front[:4]
        made = self.beam(tag, "truss", [first, last], None, {"-mass": options["-rho"]} if "-rho" in options else {})
        made.elastic = self.materials[material][0] == "Elastic"
        made.damped = bool(options.get("-doRayleigh", [0])[0])
        half = float(area) * self.units.length**2 / 2
        name = self.material_named(material)
        # A truss has an axial force alone: the places of its two fibres do not matter.
        fibres = [{"y_m": y, "area_m2": half, "material": name} for y in (-0.01, 0.01)]
        made.table["section"] = self.named("section", ("truss", half, material), f"truss-{material}", {"fibres": fibres})
        if self.ndm == 3:
            made.table["torsion_n_m2"] = 0.0

    element_truss = element_Truss

    def element_corotTruss(self, tag: int, args: list[Any]) -> None:
        raise Unfit("follows large displacements, which a truss of Gusset does not: use Truss in the script")

    element_CorotTruss = element_corotTruss

    def element_zeroLength(self, tag: int, args: list[Any]) -> None:
        front, options = self.split(args)
        self.only(options, "-mat", "-dir", "-doRayleigh", "-orient")
        if "-orient" in options:
            axes = [float(value) for value in options["-orient"]]
            if [axes[:3], axes[3:6]] not in ([[1, 0, 0], [0, 1, 0]], [[1, 0, 0], []]):
                raise Unfit("is turned with -orient, which has no counterpart")
        self.spring(tag, front[:2], options)

    def spring(self, tag: int, nodes: list[int], options: dict[str, list[Any]]) -> None:
        names = {1: "x", 2: "y", 3: "rz", 6: "rz"} if self.ndm == 2 else dict(enumerate(SPACE, 1))
        for material, direction in zip(options["-mat"], options["-dir"]):
            if material not in self.materials:
                raise Unfit(f"has the unknown material {material}")
            damped = bool(options.get("-doRayleigh", [0])[0] if options.get("-doRayleigh") != [] else 1)
            self.springs.append(Spring(tag, [int(n) for n in nodes], names[int(direction)], material, self.place, damped))

    def element_twoNodeLink(self, tag: int, args: list[Any]) -> None:
        front, options = self.split(args)
        self.only(options, "-mat", "-dir", "-doRayleigh")
        first, last = (self.nodes[node] for node in front[:2])
        if first == last:
            return self.spring(tag, front[:2], options)
        if [int(value) for value in options["-dir"]] != [1]:
            raise Unfit("acts across its axis, which has no counterpart; along its axis (-dir 1) it is known")
        damped = bool(options.get("-doRayleigh", [0])[0] if options.get("-doRayleigh") != [] else 1)
        self.springs.append(Spring(tag, front[:2], "axial", options["-mat"][0], self.place, damped))

    # ---- loads and motions ----

    def do_timeSeries(self, kind: str, tag: Any, *rest: Any) -> None:
        self.series[tag] = [kind, *rest]

    def do_pattern(self, kind: str, tag: Any, *rest: Any) -> None:
        self.pattern_now = None
        if kind == "Plain":
            self.pattern_now = {"series": rest[0], "loads": [], "beams": [], "place": self.place}
            self.pattern_now.update(analyzed=False, unloaded=False, most=0.0)
            self.patterns[tag] = self.pattern_now
        elif kind == "UniformExcitation":
            direction, options = int(rest[0]), dict(zip(rest[1::2], rest[2::2]))
            if direction > self.ndm:
                raise Unfit("is a rotation of the ground, which has no counterpart")
            unknown = set(options) - {"-accel", "-fact"}
            if unknown and (unknown != {"-vel0"} or options["-vel0"] != 0):
                raise Unfit(f"has the option {sorted(unknown)[0]}, which has no counterpart")
            factor = float(options.get("-fact", 1.0))
            self.motions.append({"direction": self.directions[direction - 1], **self.motion(options["-accel"], factor)})
        else:
            raise Unfit("has no counterpart: Plain and UniformExcitation are known")

    def do_load(self, node: int, *values: float) -> None:
        if self.pattern_now is None:
            raise Unfit("stands outside of a pattern")
        self.pattern_now["loads"].append((node, [float(value) for value in values]))

    def do_eleLoad(self, *args: Any) -> None:
        _, options = self.split(list(args))
        self.only(options, "-ele", "-range", "-type", "-beamUniform")
        values = [float(value) for value in options.get("-beamUniform", [])]
        if self.pattern_now is None or self.ndm != 2 or not values:
            raise Unfit("has no counterpart: only beamUniform in a plane is known")
        tags = [int(tag) for tag in options.get("-ele", [])]
        if "-range" in options:
            first, last = options["-range"][:2]
            tags += [beam.tag for beam in self.beams if int(first) <= beam.tag <= int(last)]
        for tag in tags:
            self.pattern_now["beams"].append((tag, values[0], values[1] if len(values) > 1 else 0.0, self.place))

    def do_sp(self, *_: Any) -> None:
        raise Unfit("has no counterpart: displacements of supports are not imported")

    def motion(self, tag: Any, factor: float) -> dict[str, Any]:
        """Values and time step of a series of accelerations, m/s² and s."""
        kind, *rest = self.series[tag]
        if kind != "Path":
            raise Unfit(f"has a time series of the kind {kind}; only Path is known for a ground motion")
        _, options = self.split(rest)
        self.only(options, "-dt", "-values", "-filePath", "-factor", "-prependZero", "-time", "-fileTime")
        if "-dt" not in options:
            raise Unfit("has a time series with single times; give it a constant step -dt")
        if "-filePath" in options:
            file = self.files[tag]
            if "wrong" in file:
                raise Unfit(f"has a record that cannot be read: {file['wrong']}")
            values = file["values"]
        else:
            values = [float(value) for value in options["-values"]]
        if "-prependZero" in options:
            values = [0.0, *values]
        factor *= float(options.get("-factor", [1.0])[0]) * self.units.length / self.units.time**2
        return {"dt": float(options["-dt"][0]) * self.units.time, "values": [value * factor for value in values]}

    # ---- damping and analysis ----

    def stiffness_part(self, numbers: list[float]) -> list[float]:
        """[a, b] of the four coefficients of `rayleigh`."""
        a, current, initial, committed = numbers
        if (current or committed) and not (self.accept_damping or self.is_linear()):
            raise Unfit("damps with the current or committed stiffness; use the initial one, or accept that with --accept-damping")
        if current or committed:
            self.notes.append("Damping with the current stiffness is imported as damping with the initial one.")
        return [a / self.units.time, (current + initial + committed) * self.units.time]

    def is_linear(self) -> bool:
        plain = all(beam.elastic and self.turns.get(beam.turned, ["Linear"])[0] == "Linear" for beam in self.beams)
        return plain and all(self.materials[spring.material][0] in ("Elastic", "Viscous") for spring in self.springs)

    def do_rayleigh(self, *numbers: float) -> None:
        a, b = self.stiffness_part([float(value) for value in numbers])
        self.node_damping = dict.fromkeys(self.nodes, a)
        self.element_damping = {element.tag: (a, b) for element in self.elements()}

    def elements(self) -> list[Beam | Spring]:
        return [*self.beams, *self.springs]

    def do_region(self, _tag: Any, *args: Any) -> None:
        _, options = self.split(list(args))
        if "-rayleigh" not in options:
            return
        a, b = self.stiffness_part([float(value) for value in options["-rayleigh"]])
        nodes: set[int] = set()
        elements: set[int] = set()
        for option, given in options.items():
            tags = {int(tag) for tag in given if not isinstance(tag, str)} if option != "-rayleigh" else set()
            every = self.nodes if option.startswith("-node") else [element.tag for element in self.elements()]
            if option.endswith("Range"):
                tags = {tag for tag in every if int(given[0]) <= tag <= int(given[1])}
            if option in ("-ele", "-eleRange"):
                elements |= tags
                nodes |= {node for element in self.elements() if element.tag in tags for node in element.nodes}
            elif option in ("-eleOnly", "-eleOnlyRange"):
                elements |= tags
            elif option in ("-node", "-nodeRange"):
                nodes |= tags
                elements |= {element.tag for element in self.elements() if set(element.nodes) <= tags}
            elif option in ("-nodeOnly", "-nodeOnlyRange"):
                nodes |= tags
            elif option != "-rayleigh":
                raise Unfit(f"has the option {option}, which has no counterpart")
        # A later command takes the place of an earlier one.
        self.node_damping.update(dict.fromkeys(nodes, a))
        self.element_damping.update(dict.fromkeys(elements, (a, b)))

    def do_modalDamping(self, *_: Any) -> None:
        raise Unfit(
            "has no counterpart: it damps only the modes that were computed. Use Rayleigh damping, or write "
            "[structure.damping.modal] by hand"
        )

    do_modalDampingQ = do_modalDamping

    def analyze(self, one: dict[str, Any], args: list[Any]) -> None:
        if "result" not in one:
            if len(args) >= 2:
                self.duration = float(args[0]) * float(args[1]) * self.units.time
            return
        if one["result"] != 0:
            self.refuse("the static analysis did not converge in OpenSees")
        for tag, factor in one["factors"]:
            pattern = self.patterns.get(tag)
            if pattern:
                pattern["analyzed"] = True
                pattern["unloaded"] = pattern["unloaded"] or abs(factor) < pattern["most"] * (1 - 1e-9)
                pattern["most"] = max(pattern["most"], abs(factor))

    def do_integrator(self, kind: str, *_: Any) -> None:
        if kind in ("DisplacementControl", "ArcLength", "ArcLength1", "MinUnbalDispNorm"):
            raise Unfit("pushes the model before the test; only loads by LoadControl are allowed there")


def is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return math.isfinite(float(word))
