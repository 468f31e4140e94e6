"""From a recorded model to the tables of a test file."""

from __future__ import annotations

from typing import Any

from . import materials
from .materials import Unfit
from .model import Beam, Model, Spring

# λ is chosen for this rotation of a corotational element; the user declares his own.
ROTATION = 0.05
# Masses below this share of the largest one are left out, and rotary ones below this share of it at the extent of the frame.
TINY = 1e-6
TINY_ROTARY = 1e-10
# Share of each degree of freedom, by node and direction.
Motion = dict[tuple[int, str], float]


class Frame:
    """The tables of `[structure.frame]`, `[structure.damping]` and the excitation."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.gone: set[int] = set()
        self.merged: set[int] = set()
        self.members: list[dict[str, Any]] = []
        self.links: list[dict[str, Any]] = []
        self.loads: dict[int, list[float]] = {}
        self.comments: dict[str, str] = {}
        self.needs_lambda = False
        self.damping = self.damped()
        for beam in model.beams:
            for node in beam.nodes:
                if node not in model.nodes:
                    self.fail(beam.place, f"element {beam.tag} has the unknown node {node}")
            if beam.mass and not model.mistakes:
                half = beam.mass * self.clear_length(beam) / 2 * model.units.mass / model.units.length
                for node in beam.nodes:
                    model.add_mass(node, half)
        if model.mistakes:
            return
        self.chains()
        self.merge()
        for beam in model.beams:
            self.guarded(beam.place, f"element {beam.tag}", lambda beam=beam: self.member(beam))
        for spring in model.springs:
            if spring.tag not in self.merged:
                self.guarded(spring.place, f"element {spring.tag}", lambda spring=spring: self.link(spring))
        self.guarded(("", 0), "loads", self.constant_loads)
        # It adds its mistakes to the others.
        self.tables(replaced=False)

    def fail(self, place: tuple[str, int], text: str) -> None:
        self.model.place = place
        self.model.refuse(text)

    def guarded(self, place: tuple[str, int], what: str, work: Any) -> None:
        try:
            work()
        except Unfit as reason:
            self.fail(place, f"{what} {reason}")

    def length(self, beam: Beam) -> float:
        first, last = (self.model.nodes[node] for node in beam.nodes)
        return float(sum((b - a) ** 2 for a, b in zip(first, last)) ** 0.5)

    def clear_length(self, beam: Beam) -> float:
        """Its length between joint offsets, which carries its mass in OpenSees."""
        at = [list(self.model.nodes[node]) for node in beam.nodes]
        rest = self.model.turns.get(beam.turned, [])
        if "-jntOffset" in rest:
            first, n = rest.index("-jntOffset") + 1, self.model.ndm
            for end in (0, 1):
                given = rest[first + end * n : first + (end + 1) * n]
                at[end] = [x + float(by) * self.model.units.length for x, by in zip(at[end], given)]
        return float(sum((b - a) ** 2 for a, b in zip(*at)) ** 0.5)

    # ---- damping ----

    def damped(self) -> dict[str, Any] | None:
        """The rule of damping, and the own coefficients of elements in `own`."""
        model = self.model
        self.own: dict[int, float] = {}

        def of(element: Beam | Spring) -> tuple[float, float]:
            return model.element_damping.get(element.tag, (0.0, 0.0)) if element.damped else (0.0, 0.0)

        carried = {model.node_damping.get(tag, 0.0) for tag, values in model.mass.items() if any(values)}
        carried |= {of(beam)[0] for beam in model.beams if beam.mass}
        if len(carried) > 1:
            self.fail(("", 0), "masses have different mass coefficients of damping; Gusset has one for all")
            return None
        a = carried.pop() if carried else 0.0
        beams = {beam.tag: of(beam)[1] for beam in model.beams}
        springs = {of(spring)[1] for spring in model.springs} - {0.0}
        if len(springs) > 1:
            self.fail(("", 0), "springs have different stiffness coefficients of damping; Gusset has one for all links")
            return None
        several = [value for value in beams.values() if value]
        b = springs.pop() if springs else max(set(several), key=several.count, default=0.0)
        for spring in model.springs:
            spring.damped = b != 0 and of(spring)[1] == b
        if a == 0 and b == 0:
            return None
        self.own = {tag: value for tag, value in beams.items() if value != b}
        rule: dict[str, Any] = {"mass_coefficient_per_s": a, "stiffness_coefficient_s": b}
        if b:
            rule["stiffness_part"] = "initial"
        return rule

    def stiffness_damping(self, beam: Beam) -> float:
        rule = self.damping or {}
        own = self.own.get(beam.tag)
        return float(rule.get("stiffness_coefficient_s", 0.0) if own is None else own)

    def chains(self) -> None:
        """OpenSees does not resolve a node that follows one in a direction and leads another one there."""
        follows = {(node, name): master for (master, along), nodes in self.model.equal.items() for node in nodes for name in along}
        for (node, name), master in follows.items():
            if (master, name) in follows:
                first = follows[(master, name)]
                text = f"node {node} follows node {master} in {name}, which follows node {first}"
                text += f": OpenSees does not resolve this. Lead both by {first}"
                self.fail(("", 0), text)

    # ---- hinges ----

    def merge(self) -> None:
        """A rotational spring between a joint and the end of one elastic member becomes a hinge of the member."""
        model = self.model
        groups: dict[int, list[Spring]] = {}
        for spring in model.springs:
            groups.setdefault(spring.tag, []).append(spring)
        at_node: dict[int, list[Beam]] = {}
        for beam in model.beams:
            for node in beam.nodes:
                at_node.setdefault(node, []).append(beam)
        springs_at: dict[int, set[int]] = {}
        for spring in model.springs:
            for node in spring.nodes:
                springs_at.setdefault(node, set()).add(spring.tag)
        for springs in groups.values():
            self.merge_one(springs, at_node, springs_at)

    def merge_one(self, springs: list[Spring], at_node: dict[int, list[Beam]], springs_at: dict[int, set[int]]) -> None:
        model = self.model
        turning = [spring for spring in springs if spring.direction == "rz"]
        if model.ndm != 2 or len(turning) != 1 or model.nodes[springs[0].nodes[0]] != model.nodes[springs[0].nodes[1]]:
            return
        for node in springs[0].nodes:
            joint = next(n for n in springs[0].nodes if n != node)
            beams = at_node.get(node, [])
            alone = len(beams) == 1 and springs_at[node] == {springs[0].tag} and not self.masses(node) and not model.fixed.get(node)
            if (
                not alone
                or beams[0].kind != "elastic"
                or beams[0].turned_from(model) == "Corotational"
                or beams[0].tag in model.replaced
            ):
                continue
            held = self.held_together(joint, node)
            if self.constrained(node) - {joint}:
                continue
            stiff = {s.direction for s in springs if s.direction != "rz" and self.is_stiff(s, beams[0])}
            if not ({"x", "y"} <= held | stiff):
                continue
            if self.stiffness_damping(beams[0]) or turning[0].damped or node in self.loaded():
                continue
            try:
                law = materials.law(model.materials[turning[0].material], model.units, True, model.materials)
            except Unfit:
                continue
            if next(iter(law)) not in ("linear", "bilinear", "imk") or law.get("linear", {}).get("damping_n_s_per_m"):
                continue
            beam = beams[0]
            end = "start" if beam.nodes[0] == node else "end"
            # The moment of a hinge turns the joint from the member, at both ends.
            if turning[0].nodes[0] == joint:
                law = materials.mirrored(law)
            name = model.named("hinge", repr(law), f"spring-{turning[0].tag}", law)
            beam.table[f"hinge_{end}"] = name
            beam.nodes = [joint if n == node else n for n in beam.nodes]
            self.comments[f"element {beam.tag}"] = (
                f"hinge at its {end}: zero-length element {springs[0].tag}, with the stiffness of the script"
            )
            self.gone.add(node)
            self.merged.add(springs[0].tag)
            return

    def is_stiff(self, spring: Spring, beam: Beam) -> bool:
        """True of a spring that only holds a hinge together."""
        kind, _, *numbers = self.model.materials[spring.material]
        section = self.model.tables["section"][beam.table["section"]]["elastic"]
        axial = section["young_pa"] * section["area_m2"] / self.length(beam)
        return bool(kind == "Elastic" and float(numbers[0]) * self.model.units.force / self.model.units.length >= 100 * axial)

    def loaded(self) -> set[int]:
        return {node for pattern in self.model.patterns.values() for node, _ in pattern["loads"]}

    def constrained(self, node: int) -> set[int]:
        """Nodes that share a constraint with this one."""
        model = self.model
        groups = [{master, *nodes} for master, nodes in [*model.rigid.items(), *model.floors.items()]]
        pairs = [{master, other} for (master, _), nodes in model.equal.items() for other in nodes]
        return set().union(*(group for group in groups + pairs if node in group)) - {node}

    def held_together(self, joint: int, node: int) -> set[str]:
        """Directions in which two nodes are equal by a constraint."""
        held: set[str] = set()
        for (master, along), nodes in self.model.equal.items():
            if (master == joint and node in nodes) or (master == node and joint in nodes):
                held |= set(along)
        return held

    # ---- members and links ----

    def member(self, beam: Beam) -> None:
        model = self.model
        table: dict[str, Any] = {"name": f"element {beam.tag}", "nodes": [str(node) for node in beam.nodes], **beam.table}
        if beam.kind != "elastic":
            table["kind"] = beam.kind
        kind, rest = "Linear", list[Any]()
        if beam.turned is not None:
            if beam.turned not in model.turns:
                raise Unfit(f"has the unknown transformation {beam.turned}")
            kind, *rest = model.turns[beam.turned]
        if kind == "PDelta":
            table["p_delta"] = True
        elif kind == "Corotational":
            table["corotational"] = {"largest_rotation_rad": ROTATION}
        numbers = [value for value in rest if not isinstance(value, str)]
        if model.ndm == 3 and beam.kind != "truss":
            table["orientation"] = self.depth(beam, [float(value) for value in numbers[:3]])
        if "-jntOffset" in rest:
            at = rest.index("-jntOffset") + 1
            offsets = [float(value) * model.units.length for value in rest[at : at + 2 * model.ndm]]
            table["offset_start_m"], table["offset_end_m"] = offsets[: model.ndm], offsets[model.ndm :]
        if beam.tag in self.own and self.damping:
            table["stiffness_coefficient_s"] = self.own[beam.tag]
        table["tag"] = beam.tag
        self.members.append(table)

    def depth(self, beam: Beam, in_plane: list[float]) -> list[float]:
        """Direction of the local axis y from a vector in the plane of x and z."""
        first, last = (self.model.nodes[node] for node in beam.nodes)
        along = [b - a for a, b in zip(first, last)]
        x, v = along, in_plane
        y = [v[1] * x[2] - v[2] * x[1], v[2] * x[0] - v[0] * x[2], v[0] * x[1] - v[1] * x[0]]
        size = sum(value * value for value in y) ** 0.5
        if size == 0:
            raise Unfit("has a vector of its transformation along its axis")
        return [value / size for value in y]

    def link(self, spring: Spring) -> None:
        model = self.model
        kind = model.materials[spring.material][0]
        try:
            law = materials.law(model.materials[spring.material], model.units, spring.direction.startswith("r"), model.materials)
        except Unfit as reason:
            raise Unfit(f"has the material {kind} {spring.material}, which {reason}") from None
        if {"hysteretic", "pinching4"} & set(law):
            self.needs_lambda = True
        table: dict[str, Any] = {
            "name": f"element {spring.tag} {spring.direction}",
            "nodes": [str(node) for node in spring.nodes],
            "direction": spring.direction,
            "law": law,
        }
        if spring.damped:
            table["damped"] = True
        table["tag"] = spring.tag
        self.links.append(table)

    # ---- loads ----

    def constant_loads(self) -> None:
        model = self.model
        for tag, factor in model.constant.items():
            pattern = model.patterns.get(tag)
            if pattern is None:
                continue
            for node, values in pattern["loads"]:
                self.add_load(node, [value * factor for value in values])
            for element, across, along, place in pattern["beams"]:
                self.model.place = place
                self.beam_load(element, across * factor, along * factor)

    def add_load(self, node: int, values: list[float]) -> None:
        """Adds forces at a node, in units of the model."""
        model = self.model
        known = self.loads.setdefault(node, [0.0] * len(model.directions))
        for i, (name, value) in enumerate(zip(model.given_directions(), values)):
            known[i] += value * model.units.force * (model.units.length if name.startswith("r") else 1.0)

    def beam_load(self, tag: int, across: float, along: float) -> None:
        """Forces of an equally loaded beam on its nodes: exact for their displacements if it is elastic or displacement-based."""
        model = self.model
        beam = next((beam for beam in model.beams if beam.tag == tag), None)
        if beam is None:
            raise Unfit(f"has a load on the unknown element {tag}")
        fits = beam.kind in ("elastic", "displacement_based") and not {"release", "hinge_start", "hinge_end"} & set(beam.table)
        if not fits or "-jntOffset" in model.turns.get(beam.turned, []):
            raise Unfit(
                f"has a load along element {tag}: only that of an elastic or displacement-based beam without hinges is known. "
                "Load its nodes"
            )
        (x1, y1), (x2, y2) = (model.nodes[node] for node in beam.nodes)
        length = self.length(beam) / model.units.length
        c, s = (x2 - x1) / self.length(beam), (y2 - y1) / self.length(beam)
        force, moment = (along * length / 2, across * length / 2), across * length**2 / 12
        in_frame = [force[0] * c - force[1] * s, force[0] * s + force[1] * c]
        for node, sign in zip(beam.nodes, (1, -1)):
            self.add_load(node, [*in_frame, sign * moment])

    # ---- the whole ----

    def tables(self, replaced: bool) -> dict[str, Any]:
        """`[structure.frame]`; without the elements that a specimen replaces, if `replaced`."""
        model = self.model
        out = {element for element in model.replaced} if replaced else set()
        nodes = []
        for tag, at in model.nodes.items():
            if tag in self.gone:
                continue
            table: dict[str, Any] = {"name": str(tag), "at_m": at}
            table.update(self.masses(tag))
            held = [name for name in model.directions if name in model.fixed.get(tag, set())]
            if held:
                table["fixed"] = held
            nodes.append(table)
        made: dict[str, Any] = {"node": nodes}
        if model.ndm == 3:
            made["dimension"] = 3
        made["member"] = [plain(member) for member in self.members if member["tag"] not in out]
        links = [plain(link) for link in self.links if link["tag"] not in out]
        if links:
            made["link"] = links
        constraints: list[dict[str, Any]] = []
        for (master, along), nodes_ in model.equal.items():
            kept = [str(node) for node in nodes_ if node not in self.gone]
            if kept and master not in self.gone:
                constraints.append({"equal": {"master": str(master), "nodes": kept, "directions": list(along)}})
        constraints += [{"rigid": {"master": str(m), "nodes": [str(n) for n in nodes_]}} for m, nodes_ in model.rigid.items()]
        constraints += [{"diaphragm": {"master": str(m), "nodes": [str(n) for n in nodes_]}} for m, nodes_ in model.floors.items()]
        if constraints:
            made["constraint"] = constraints
        loads = []
        for node, values in self.loads.items():
            named = (
                (f"{name}_n_m" if name.startswith("r") else f"{name}_n", value) for name, value in zip(model.directions, values)
            )
            held_ = {key: value for key, value in named if value}
            if held_:
                loads.append({"node": str(node), **held_})
        if loads:
            made["load"] = loads
        for name in ("material", "section", "hinge"):
            if model.tables[name]:
                made[name] = model.tables[name]
        return made

    def masses(self, tag: int) -> dict[str, Any]:
        """Mass of a node. Its directions without restraint must have one mass."""
        model = self.model
        values = model.mass.get(tag)
        if not values or not any(values):
            return {}
        held = model.fixed.get(tag, set())
        shifts = {name: value for name, value in zip(model.directions, values) if not name.startswith("r")}
        free = {name: value for name, value in shifts.items() if name not in held}
        most = max(free.values(), default=0.0)
        # A tiny mass is there for the solver of OpenSees alone.
        largest = self.largest_mass()
        tiny = [name for name, value in free.items() if value < TINY * largest]
        if any(value != most for name, value in free.items() if name not in tiny):
            self.own_mass(tag, shifts)
        table: dict[str, Any] = {"mass_kg": most if len(tiny) < len(free) else 0.0}
        if table["mass_kg"] and tiny:
            table["massless"] = tiny
        least = TINY_ROTARY * largest * self.size() ** 2
        turns = {name: value if value >= least else 0.0 for name, value in zip(model.directions, values) if name.startswith("r")}
        if turns.get("rz"):
            table["rotary_mass_kg_m2"] = turns["rz"]
        if model.ndm == 3 and (turns["rx"] or turns["ry"]):
            table["tilting_mass_kg_m2"] = [turns["rx"], turns["ry"]]
        return {key: value for key, value in table.items() if value}

    def largest_mass(self) -> float:
        """The largest mass of a direction of a node, kg."""
        return max((max(values[: self.model.ndm]) for values in self.model.mass.values()), default=0.0)

    def size(self) -> float:
        """The largest extent of the frame, m."""
        places = list(zip(*self.model.nodes.values()))
        return float(max(max(values) - min(values) for values in places))

    def own_mass(self, tag: int, shifts: dict[str, float]) -> None:
        found = ", ".join(f"{name} {value:g} kg" for name, value in shifts.items())
        self.fail(("", 0), f"node {tag} has different masses in its directions ({found}); Gusset has one mass of a node")

    # ---- deformations of a replaced element ----

    def motion(self, node: int, direction: str) -> Motion:
        """A direction of a node as a sum of directions that are degrees of freedom."""
        model = self.model
        if direction in model.fixed.get(node, set()):
            return {}
        for (master, along), nodes in model.equal.items():
            if node in nodes and direction in along:
                return self.motion(master, direction)
        for master, nodes in model.rigid.items():
            if node in nodes and model.ndm == 2:
                dx, dy = (b - a for a, b in zip(model.nodes[master], model.nodes[node]))
                found = self.motion(master, direction)
                share = {"x": -dy, "y": dx, "rz": 0.0}[direction]
                for key, value in self.motion(master, "rz").items():
                    found[key] = found.get(key, 0.0) + share * value
                return found
        return {(node, direction): 1.0}

    def deformations(self, tag: int) -> list[Motion]:
        """Elongation and rotations from the chord at both ends of an element in a plane."""
        beam = next((beam for beam in self.model.beams if beam.tag == tag), None)
        if beam is None or self.model.ndm != 2 or beam.kind == "truss" or "-jntOffset" in self.model.turns.get(beam.turned, []):
            raise Unfit("cannot become a specimen: only a beam or column of a plane frame without joint offsets can")
        (x1, y1), (x2, y2) = (self.model.nodes[node] for node in beam.nodes)
        length = self.length(beam)
        c, s = (x2 - x1) / length, (y2 - y1) / length
        first, last = beam.nodes
        rows = [
            {(first, "x"): -c, (first, "y"): -s, (last, "x"): c, (last, "y"): s},
            *(
                {
                    (first, "x"): -s / length,
                    (first, "y"): c / length,
                    (last, "x"): s / length,
                    (last, "y"): -c / length,
                    (end, "rz"): 1.0,
                }
                for end in (first, last)
            ),
        ]
        made = []
        for row in rows:
            total: Motion = {}
            for (node, direction), value in row.items():
                for key, share in self.motion(node, direction).items():
                    total[key] = total.get(key, 0.0) + value * share
            made.append(total)
        return made


def plain(table: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key != "tag"}
