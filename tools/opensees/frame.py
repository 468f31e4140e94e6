#!/usr/bin/env python3
"""The frame of a test file in OpenSees: displacements under the static loads, frequencies, and the course under a ground motion.

Usage: frame.py TEST.toml [SUBSTEPS]
Prints one line of JSON: {"disp": {node: [x, y, rz]}, "frequencies_rad_per_s": [...], "course": {node: [[x, y, rz], ...]},
"forces": [[[axial force, moment at the start, moment at the end], ...], ...]}; in space nodes have x, y, z, rx, ry, rz, and members six forces.
Without SUBSTEPS it tells the frequencies at rest, if all members are elastic. With SUBSTEPS it tells the course, which has one row for each step of the
test, and that of the forces of each member with `record = true`; each step is made in so many of Newmark's method with Newton's iteration. Each component of the ground moves as its `signal.sine`.
"""

import math
import sys
import time
import tomllib

import peer

PLANE = {"x": 1, "y": 2, "rz": 3}
SPACE = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}
# OpenSees needs twice as many directions with mass.
MODES = 3

ops = peer.opensees()


def circle(radius, bottom, top):
    """Area of a circle between two heights, and its first moment."""
    def at(y):
        y = max(-radius, min(radius, y))
        half = math.sqrt(max(radius**2 - y**2, 0))
        angle = math.asin(y / radius) if radius > 0 else 0
        return y * half + radius**2 * angle, -2 / 3 * half**3
    below, above = at(bottom), at(top)
    return above[0] - below[0], above[1] - below[1]


def strip(y, depth, width, layers, across=1, z=0.0):
    """Fibres of a rectangle around y and z: (y, z, area)."""
    each, wide = depth / layers, width / across
    return [(y - depth / 2 + (i + 0.5) * each, z + (k + 0.5 - across / 2) * wide, each * wide)
            for i in range(layers) for k in range(across)]


def fibres(section, in_space):
    """Fibres of a section, (y, z, area, material), as the guide describes them."""
    (kind, s), = section.items()
    if kind == "fibres":
        return [(f["y_m"], f.get("z_m", 0.0), f["area_m2"], f["material"]) for f in s]
    layers = s.get("layers", 20)
    across = s.get("layers_across", 8) if in_space else 1
    if kind == "rc_rectangle":
        cover, b, h = s["cover_m"], s["width_m"], s["depth_m"]
        inside, few = h - 2 * cover, max(int(cover / (h - 2 * cover) * layers), 1)
        clear = b - 2 * cover
        sides = (-0.5, 0.5) if in_space else (0.0,)
        edge = strip(-(h - cover) / 2, cover, b, few, across) + strip((h - cover) / 2, cover, b, few, across)
        bars = []
        for side in sides:
            edge += strip(0, inside, 2 * cover / len(sides), layers, 1, side * (b - cover))
            bars += [(y, side * clear, s.get(key, 0) / len(sides)) for y, key in
                     ((-inside / 2, "bottom_area_m2"), (0.0, "middle_area_m2"), (inside / 2, "top_area_m2"))]
        core = strip(0, inside, clear, layers, across)
        return ([(*at, s["concrete"]) for at in edge] + [(*at, s.get("core", s["concrete"])) for at in core]
                + [(*at, s["steel"]) for at in bars if at[2] > 0])
    if kind == "rectangle":
        cut = strip(0, s["depth_m"], s["width_m"], layers, across)
    elif kind == "i_shape":
        h, f = s["depth_m"], s["flange_thickness_m"]
        few = -(-layers // 5)
        cut = (strip(-(h - f) / 2, f, s["flange_width_m"], few, across)
               + strip(0, h - 2 * f, s["web_thickness_m"], max(layers - 2 * few, 1))
               + strip((h - f) / 2, f, s["flange_width_m"], few, across))
    elif in_space:
        cut = sectors(s["diameter_m"] / 2, s["diameter_m"] / 2 - s["thickness_m"] if kind == "tube" else 0, layers)
    else:
        d = s["diameter_m"]
        inner = d - 2 * s["thickness_m"] if kind == "tube" else 0
        cut = []
        for i in range(layers):
            bottom, top = i * d / layers - d / 2, (i + 1) * d / layers - d / 2
            (a, m), (b, n) = circle(d / 2, bottom, top), circle(inner / 2, bottom, top)
            cut.append(((m - n) / (a - b), 0.0, a - b))
    return [(*at, s["material"]) for at in cut]


def sectors(outer, inner, count):
    """A ring in sectors, each at its centre of area."""
    rings, half, cut = 2 if inner > 0 else -(-count // 4), math.pi / count, []
    for ring in range(rings):
        a, b = (inner + (outer - inner) * edge / rings for edge in (ring, ring + 1))
        radius = 2 / 3 * (b**3 - a**3) / (b**2 - a**2) * math.sin(half) / half
        cut += [(radius * math.cos((2 * k + 1) * half), radius * math.sin((2 * k + 1) * half), (b**2 - a**2) * half)
                for k in range(count)]
    return cut


def torsion(section, materials):
    """G J with G = E/2.6."""
    (kind, s), = section.items()
    young = s["young_pa"] if "young_pa" in s else first_modulus(materials[s["material"]])
    if kind == "elastic":
        j = s["torsion_m4"]
    elif kind == "rectangle":
        long, short = max(s["width_m"], s["depth_m"]), min(s["width_m"], s["depth_m"])
        t = short / long
        j = long * short**3 * (1 / 3 - 0.21 * t * (1 - t**4 / 12))
    elif kind == "i_shape":
        f, w = s["flange_thickness_m"], s["web_thickness_m"]
        j = (2 * s["flange_width_m"] * f**3 + (s["depth_m"] - 2 * f) * w**3) / 3
    else:
        d = s["diameter_m"]
        j = math.pi / 32 * (d**4 - (d - 2 * s["thickness_m"] if kind == "tube" else 0)**4)
    return young / 2.6 * j


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def rigidity(section, materials):
    """Young's modulus, area and second moment of area."""
    (kind, s), = section.items()
    if kind == "elastic":
        return s["young_pa"], s["area_m2"], s["inertia_m4"]
    if "young_pa" not in s:
        moduli = [(y, a * first_modulus(materials[name])) for y, _, a, name in fibres(section, False)]
        return 1.0, sum(ea for _, ea in moduli), sum(ea * y * y for y, ea in moduli)
    if kind == "rectangle":
        b, h = s["width_m"], s["depth_m"]
        return s["young_pa"], b * h, b * h**3 / 12
    if kind == "i_shape":
        b, h, f, w = s["flange_width_m"], s["depth_m"], s["flange_thickness_m"], s["web_thickness_m"]
        clear = h - 2 * f
        return s["young_pa"], b * h - (b - w) * clear, (b * h**3 - (b - w) * clear**3) / 12
    d = s["diameter_m"]
    inner = d - 2 * s["thickness_m"] if kind == "tube" else 0
    return s["young_pa"], math.pi / 4 * (d**2 - inner**2), math.pi / 64 * (d**4 - inner**4)


def weak_inertia(section, materials):
    """Second moment of area over the width, to the modulus of `rigidity`."""
    (kind, s), = section.items()
    if kind != "elastic" and "young_pa" not in s:
        return sum(z * z * a * first_modulus(materials[name]) for _, z, a, name in fibres(section, True))
    if kind == "elastic":
        return s["weak_inertia_m4"]
    if kind == "rectangle":
        return s["depth_m"] * s["width_m"]**3 / 12
    if kind == "i_shape":
        b, f, w = s["flange_width_m"], s["flange_thickness_m"], s["web_thickness_m"]
        return (2 * f * b**3 + (s["depth_m"] - 2 * f) * w**3) / 12
    return rigidity(section, {})[2]


def first_modulus(material):
    (kind, m), = material.items()
    return m["young_pa"] if "young_pa" in m else 2 * m["strength_pa"] / m["strain_at_strength"]


def material(tag, of):
    """A uniaxial material of fibres."""
    (kind, m), = of.items()
    if kind == "elastic":
        ops.uniaxialMaterial("Elastic", tag, m["young_pa"])
    elif kind == "elastic_no_tension":
        ops.uniaxialMaterial("ENT", tag, m["young_pa"])
    elif kind == "menegotto_pinto":
        ops.uniaxialMaterial("Steel02", tag, m["yield_pa"], m["young_pa"], m["hardening_ratio"], m.get("r0", 20.0), m.get("cr1", 0.925),
                             m.get("cr2", 0.15), m.get("a1", 0.0), m.get("a2", 1.0), m.get("a3", 0.0), m.get("a4", 1.0))
    else:
        shape = [-m[key] for key in ("strength_pa", "strain_at_strength", "crushing_strength_pa", "crushing_strain")]
        if kind == "concrete_01":
            ops.uniaxialMaterial("Concrete01", tag, *shape)
        else:
            ops.uniaxialMaterial("Concrete02", tag, *shape, m["unloading_ratio"], m["tensile_strength_pa"], m["tension_softening_pa"])


def law(tag, of):
    """A force law of a link or hinge."""
    (kind, s), = of.items()
    if kind == "linear":
        ops.uniaxialMaterial("Elastic", tag, s["stiffness_n_per_m"], s.get("damping_n_s_per_m", 0.0))
    elif kind == "bilinear":
        ops.uniaxialMaterial("Steel01", tag, s["yield_force_n"], s["stiffness_n_per_m"], s["post_yield_ratio"])
    elif kind == "imk" and s.get("response", "bilinear") == "bilinear" and "negative" not in s:
        shape = [s["plastic_disp_m"], s["post_capping_disp_m"], s["ultimate_disp_m"], s["yield_force_n"], s["capping_ratio"],
                 s.get("residual_ratio", 0)]
        # A capacity that no test uses up: OpenSees has no number for no deterioration.
        modes = ("strength", "post_capping", "unloading")
        capacities = [s.get(f"{mode}_lambda_m", 0) or 1e9 for mode in modes]
        exponents = [s.get(f"{mode}_exponent", 1) for mode in modes]
        ops.uniaxialMaterial("IMKBilin", tag, *map(float, [s["stiffness_n_per_m"], *shape, *shape, *capacities, *exponents, 1, 1]))
    else:
        sys.exit(f"this script does not know the law {kind}")


class Model:
    """Builds the model; tags of nodes are in `tags`."""

    def __init__(self, frame):
        ops.wipe()
        self.in_space = frame.get("dimension", 2) == 3
        self.directions = SPACE if self.in_space else PLANE
        ops.model("basic", "-ndm", 3 if self.in_space else 2, "-ndf", len(self.directions))
        self.frame, self.tags, self.next = frame, {}, 10_000
        self.recorded = []
        self.is_elastic = True
        for tag, node in enumerate(frame["node"], 1):
            self.tags[node["name"]] = tag
            ops.node(tag, *map(float, node["at_m"]))
            fixed = node.get("fixed", [])
            ops.fix(tag, *(int(name in fixed) for name in self.directions))
            mass = [float(node.get("mass_kg", 0))] * 3
            turning = [*map(float, node.get("tilting_mass_kg_m2", [0, 0])), float(node.get("rotary_mass_kg_m2", 0))]
            ops.mass(tag, *(mass + turning if self.in_space else mass[:2] + turning[2:]))
        self.materials = {}
        for name, of in frame.get("material", {}).items():
            self.materials[name] = self.new()
            material(self.materials[name], of)
        for member in frame.get("member", []):
            self.member(member)
        for link in frame.get("link", []):
            self.link(link)
        for constraint in frame.get("constraint", []):
            (kind, c), = constraint.items()
            for name in c["nodes"]:
                if kind == "diaphragm" and self.in_space:
                    ops.rigidDiaphragm(3, self.tags[c["master"]], self.tags[name])
                elif kind == "rigid":
                    ops.rigidLink("beam", self.tags[c["master"]], self.tags[name])
                else:
                    along = c["directions"] if kind == "equal" else ["x"]
                    ops.equalDOF(self.tags[c["master"]], self.tags[name], *(self.directions[d] for d in along))
        ops.timeSeries("Linear", 1)
        ops.pattern("Plain", 1, 1)
        for load in frame.get("load", []):
            keys = (name + ("_n_m" if "r" in name else "_n") for name in self.directions)
            ops.load(self.tags[load["node"]], *(float(load.get(key, 0)) for key in keys))

    def new(self):
        self.next += 1
        return self.next

    def member(self, member):
        frame, tag = self.frame, self.new()
        if member.get("record"):
            self.recorded.append(tag)
        section = frame["section"][member["section"]]
        start, end = (self.tags[name] for name in member["nodes"])
        kind = member.get("kind", "elastic")
        if kind == "truss":
            self.is_elastic = False
            parts = fibres(section, False)
            ops.element("Truss", tag, start, end, sum(a for _, _, a, _ in parts), self.materials[parts[0][3]])
            return
        none = [0, 0, 0] if self.in_space else [0, 0]
        offsets = [[float(v) for v in member.get(key, none)] for key in ("offset_start_m", "offset_end_m")]
        z = []
        if self.in_space:
            first, last = ([x + o for x, o in zip(ops.nodeCoord(node), by)] for node, by in zip((start, end), offsets))
            way = [b - a for a, b in zip(first, last)]
            upright = abs(way[0]) + abs(way[1]) < 1e-6 * abs(way[2])
            z = cross(way, member.get("orientation", [1, 0, 0] if upright else [0, 0, 1]))
        geometry = "Corotational" if "corotational" in member else "PDelta" if member.get("p_delta") else "Linear"
        ops.geomTransf(geometry, tag, *map(float, z), "-jntOffset", *offsets[0], *offsets[1])
        twists = member.get("torsion_n_m2") or torsion(section, frame.get("material", {})) if self.in_space else 0.0
        if kind == "elastic":
            start, end = self.hinge(start, member.get("hinge_start"), 1), self.hinge(end, member.get("hinge_end"), -1)
            young, area, inertia = rigidity(section, frame.get("material", {}))
            release = sum({"start": 1, "end": 2}[side] for side in member.get("release", []))
            if self.in_space:
                ops.element("elasticBeamColumn", tag, start, end, area, young, young / 2.6, twists / young * 2.6, weak_inertia(section, frame.get("material", {})),
                            inertia, tag, "-releasez", release, "-releasey", release)
            else:
                ops.element("elasticBeamColumn", tag, start, end, area, young, inertia, tag, "-release", release)
            return
        self.is_elastic = False
        ops.section("Fiber", tag, *(["-GJ", twists] if self.in_space else []))
        for y, z, area, name in fibres(section, self.in_space):
            ops.fiber(y, z, area, self.materials[name])
        if kind == "force_based":
            ops.beamIntegration("Lobatto", tag, tag, member.get("points", 5))
            ops.element("forceBeamColumn", tag, start, end, tag, tag, "-iter", 50, 1e-14)
        else:
            ops.beamIntegration("Legendre", tag, tag, member.get("points", 3))
            ops.element("dispBeamColumn", tag, start, end, tag, tag)

    def hinge(self, node, name, sign):
        """A node at the same place that turns by itself, behind a spring."""
        if name is None:
            return node
        self.is_elastic = False
        tag = self.new()
        ops.node(tag, *ops.nodeCoord(node))
        law(tag, self.frame["hinge"][name])
        # The node may follow another one, so it cannot lead this one.
        stiff = self.new()
        ops.uniaxialMaterial("Elastic", stiff, 1e13)
        ends = (node, tag) if sign > 0 else (tag, node)
        ops.element("zeroLength", tag, *ends, "-mat", stiff, stiff, tag, "-dir", 1, 2, 3)
        return tag

    def link(self, link):
        self.is_elastic = False
        tag = self.new()
        start, end = (self.tags[name] for name in link["nodes"])
        if "bearing" in link:
            return self.bearing(tag, start, end, link["bearing"])
        law(tag, link["law"])
        if link["direction"] == "axial":
            ops.element("twoNodeLink", tag, start, end, "-mat", tag, "-dir", 1)
        else:
            ops.element("zeroLength", tag, start, end, "-mat", tag, "-dir", self.directions[link["direction"]])

    def bearing(self, tag, start, end, of):
        """A bearing whose axis points upwards."""
        (kind, s), = of.items()
        ops.uniaxialMaterial("Elastic", tag, s.get("vertical_stiffness_n_per_m", 1e9))
        # It does not resist a twist.
        free = self.new()
        ops.uniaxialMaterial("Elastic", free, 1.0)
        others = ["-P", tag, "-T", free, "-My", tag, "-Mz", tag, "-orient", 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
        if kind == "elastomeric":
            first, last = s["stiffness_n_per_m"], s["post_yield_stiffness_n_per_m"]
            ops.element("elastomericBearingPlasticity", tag, start, end, first, s["characteristic_strength_n"], last / first, 0.0, 1.0, *others)
            return
        ops.frictionModel("Coulomb", tag, s["friction_slow"])
        ops.element("singleFPBearing", tag, start, end, tag, s["radius_m"], s["stiffness_n_per_m"], *others, "-iter", 100, 1e-8)


def settle(tolerance):
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", tolerance, 100)
    ops.algorithm("Newton")


def course(test, model, substeps):
    """Rows of displacements and of forces of members, one for each step, under the ground motion; and the time of a step."""
    rate, duration = test["time"]["rate_hz"], test["time"]["duration_s"]
    steps = round(rate * duration)
    grounds = test["excitation"]["ground_acceleration"]
    ops.loadConst("-time", 0.0)
    for tag, ground in enumerate([grounds] if isinstance(grounds, dict) else grounds, 2):
        sine = ground["signal"]["sine"]
        values = [sine["amplitude"] * math.sin(2 * math.pi * sine["frequency_hz"] * n / rate) for n in range(steps + 2)]
        ops.timeSeries("Path", tag, "-dt", 1 / rate, "-values", *values)
        ops.pattern("UniformExcitation", tag, model.directions[ground.get("direction", "x")], "-accel", tag)
    ops.rayleigh(test["structure"]["damping"]["rayleigh"]["mass_coefficient_per_s"], 0.0, 0.0, 0.0)
    ops.wipeAnalysis()
    settle(1e-10)
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    rows = {name: [ops.nodeDisp(tag)] for name, tag in model.tags.items()}
    forces = [[ops.basicForce(tag)] for tag in model.recorded]
    begun = time.process_time()
    for _ in range(steps - 1):
        if ops.analyze(substeps, 1 / rate / substeps) != 0:
            sys.exit("no equilibrium in a step")
        for name, tag in model.tags.items():
            rows[name].append(ops.nodeDisp(tag))
        for course, tag in zip(forces, model.recorded):
            course.append(ops.basicForce(tag))
    return rows, forces, (time.process_time() - begun) / (steps * substeps)


def main():
    with open(sys.argv[1], "rb") as file:
        test = tomllib.load(file)
    model = Model(test["structure"]["frame"])
    settle(1e-14 if model.is_elastic else 1e-13)
    ops.integrator("LoadControl", 0.1)
    ops.analysis("Static")
    if ops.analyze(10) != 0:
        sys.exit("no equilibrium under the static loads")
    told = {"disp": {name: ops.nodeDisp(tag) for name, tag in model.tags.items()}}
    if len(sys.argv) == 2 and model.is_elastic:
        told["frequencies_rad_per_s"] = [math.sqrt(value) for value in ops.eigen("-genBandArpack", MODES)]
    if len(sys.argv) > 2:
        told["course"], told["forces"], told["seconds_per_step"] = course(test, model, int(sys.argv[2]))
    peer.tell(**told)


main()
