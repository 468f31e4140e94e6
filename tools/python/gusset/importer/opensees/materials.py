"""Uniaxial materials of OpenSees as materials of fibres and as laws."""

from __future__ import annotations

from typing import Any

from ..units import Units

# Exponent of Menegotto and Pinto with which the transition to yielding is a corner: the stress there is 0.03 % lower.
SHARP = 2000.0


class Unfit(Exception):
    """A command without counterpart."""


def given(args: list[Any], least: int, defaults: tuple[float, ...] = ()) -> list[float]:
    """The numbers after kind and tag: `least` of them, and defaults for those that may be missing."""
    numbers = [float(value) for value in args[2:] if not isinstance(value, str)]
    if len(numbers) < least:
        raise Unfit(f"has {len(numbers)} numbers, but needs {least}")
    return numbers + list(defaults[max(0, len(numbers) - least) :])


def is_steel(kind: str) -> bool:
    return kind in ("Steel01", "ElasticPP", "Hardening")


def steel(args: list[Any]) -> tuple[float, float, float]:
    """Young's modulus, yield stress and hardening ratio of a bilinear material."""
    kind = args[0]
    if kind == "Steel01":
        fy, young, ratio, *more = given(args, 3)
        if any(more[::2]):
            raise Unfit("has isotropic hardening (a1, a3), which the bilinear law does not have")
        return young, fy, ratio
    if kind == "ElasticPP":
        young, strain, *more = given(args, 2)
        if more and (more[0] != -strain or any(more[1:])):
            raise Unfit("yields at another strain in compression, or starts at another strain than 0")
        return young, young * strain, 0.0
    young, fy, isotropic, kinematic = given(args, 4)[:4]
    if isotropic != 0:
        raise Unfit("has isotropic hardening, which the bilinear law does not have")
    return young, fy, kinematic / (young + kinematic)


def of_fibres(args: list[Any], units: Units) -> dict[str, Any]:
    """A material of `[structure.frame.material]`."""
    kind, stress = args[0], units.force / units.length**2
    if kind == "Elastic":
        young, *more = given(args, 1)
        if any(more[:1]) or any(negative != young for negative in more[1:2]):
            raise Unfit("has damping or another modulus in compression, which a fibre does not have")
        return {"elastic": {"young_pa": young * stress}}
    if kind == "ENT":
        return {"elastic_no_tension": {"young_pa": given(args, 1)[0] * stress}}
    if is_steel(kind):
        young, fy, ratio = steel(args)
        return {
            "menegotto_pinto": {
                "young_pa": young * stress,
                "yield_pa": fy * stress,
                "hardening_ratio": ratio,
                "r0": SHARP,
                "cr1": 0.0,
            }
        }
    if kind == "Steel02":
        fy, young, ratio, r0, cr1, cr2, a1, a2, a3, a4, initial = given(args, 3, (15.0, 0.925, 0.15, 0.0, 1.0, 0.0, 1.0, 0.0))[:11]
        if initial != 0:
            raise Unfit("has an initial stress, which a fibre does not have")
        curve = {"r0": r0, "cr1": cr1, "cr2": cr2, "a1": a1, "a2": a2, "a3": a3, "a4": a4}
        return {"menegotto_pinto": {"young_pa": young * stress, "yield_pa": fy * stress, "hardening_ratio": ratio, **curve}}
    if kind in ("Concrete01", "Concrete02"):
        strength, strain, crushed, ultimate = (abs(value) for value in given(args, 4)[:4])
        shape = {
            "strength_pa": strength * stress,
            "strain_at_strength": strain,
            "crushing_strength_pa": crushed * stress,
            "crushing_strain": ultimate,
        }
        if kind == "Concrete01":
            return {"concrete_01": shape}
        ratio, tensile, softening = given(args, 7)[4:7]
        in_tension = {"tensile_strength_pa": tensile * stress, "tension_softening_pa": softening * stress}
        return {"concrete_02": {**shape, "unloading_ratio": ratio, **in_tension}}
    raise Unfit("has no counterpart as a material of fibres")


def law(args: list[Any], units: Units, turns: bool, materials: dict[Any, list[Any]]) -> dict[str, Any]:
    """A law of a link or hinge: force over displacement, or moment over rotation."""
    kind = args[0]
    disp = 1.0 if turns else units.length
    force = units.force * units.length if turns else units.force
    rate = force / disp
    if kind == "Elastic":
        stiffness, *more = given(args, 1)
        if any(negative != stiffness for negative in more[1:2]):
            raise Unfit("has another stiffness in compression")
        made = {"stiffness_n_per_m": stiffness * rate}
        if any(more[:1]):
            made["damping_n_s_per_m"] = more[0] * rate * units.time
        return {"linear": made}
    if is_steel(kind):
        stiffness, strength, ratio = steel(args)
        return {"bilinear": {"stiffness_n_per_m": stiffness * rate, "yield_force_n": strength * force, "post_yield_ratio": ratio}}
    if kind == "Viscous":
        damping, exponent, *_ = given(args, 2)
        if exponent == 1:
            return {"linear": {"stiffness_n_per_m": 0.0, "damping_n_s_per_m": damping * rate * units.time}}
        at_one = damping * force * (units.time / disp) ** exponent
        return {"power_damper": {"force_at_unit_velocity_n": at_one, "exponent": exponent, **steepness(at_one, exponent)}}
    if kind == "ViscousDamper":
        stiffness, damping, exponent, *more = given(args, 3)
        if any(more[:1]):
            raise Unfit("has a gap (LGap), which the law does not have")
        scale = force * (units.time / disp) ** exponent
        return {
            "maxwell": {"stiffness_n_per_m": stiffness * rate, "force_at_unit_velocity_n": damping * scale, "exponent": exponent}
        }
    if kind in ("Bilin", "IMKBilin", "IMKPeakOriented"):
        return {"imk": imk(args, disp, force)}
    if kind == "Hysteretic":
        return {"hysteretic": hysteretic(args, disp, force)}
    if kind == "Pinching4":
        return {"pinching4": pinching4(args, disp, force)}
    if kind == "SelfCentering":
        first, second, activation, beta, slip, bearing, ratio = given(args, 4, (0.0, 0.0, 0.0))[:7]
        made = {
            "stiffness_n_per_m": first * rate,
            "activation_force_n": activation * force,
            "post_activation_ratio": second / first,
            "beta": beta,
        }
        if slip:
            made["slip_disp_m"] = slip * disp
        if bearing:
            made.update({"bearing_disp_m": bearing * disp, "bearing_ratio": ratio})
        return {"self_centring": made}
    if kind == "Parallel":
        tags = [value for value in args[2:] if not isinstance(value, str)]
        if "-factors" in args or any(tag not in materials for tag in tags):
            raise Unfit("has factors or unknown materials")
        return {"parallel": [law(materials[tag], units, turns, materials) for tag in tags]}
    raise Unfit("has no counterpart as a law")


def steepness(at_one: float, exponent: float) -> dict[str, float]:
    """What bounds the tangent of a damper whose force is steep at rest."""
    return {"reference_damping_n_s_per_m": at_one * 0.1 ** (exponent - 1), "linear_below_m_per_s": 1e-3} if exponent < 1 else {}


def imk(args: list[Any], disp: float, force: float) -> dict[str, Any]:
    """A hinge of Ibarra, Medina and Krawinkler."""
    kind = args[0]
    if kind == "Bilin":
        numbers = given(args, 23, (0.0,))
        stiffness, rise, rise_negative, strength, strength_negative = numbers[:5]
        lambdas, exponents = numbers[5:9], numbers[9:13]
        plastic, post, residual, ultimate, factor = ((numbers[i], numbers[i + 1]) for i in range(13, 23, 2))
        if numbers[23] != 0:
            raise Unfit("has an nFactor; give the amplified stiffness and its hardening ratio instead")
        sides = [(rise, -rise_negative if rise_negative < 0 else rise_negative), (strength, -strength_negative)]
        if any(lambdas) or any(a != b for a, b in [*sides, plastic, post, residual, ultimate]):
            raise Unfit(
                "deteriorates or differs in its directions, where Bilin is not IMKBilin in OpenSees: use IMKBilin in the script"
            )
        # Strength, post-capping, accelerated reloading, unloading.
        order = ["strength", "post_capping", "reloading", "unloading"]
        caps = [
            1 + abs(each * stiffness * of / bound)
            for each, of, bound in ((rise, plastic[0], strength), (rise_negative, plastic[1], strength_negative))
        ]
    else:
        count = 23 if kind == "IMKPeakOriented" else 21
        numbers = given(args, count)
        stiffness = numbers[0]
        one, other = numbers[1:7], numbers[7:13]
        plastic, post, ultimate = ((one[i], other[i]) for i in range(3))
        strength, strength_negative = one[3], other[3]
        caps, residual = [one[4], other[4]], (one[5], other[5])
        order = ["strength", "post_capping", *(["reloading"] if kind == "IMKPeakOriented" else []), "unloading"]
        n = len(order)
        lambdas, exponents, factor = numbers[13 : 13 + n], numbers[13 + n : 13 + 2 * n], (numbers[13 + 2 * n], numbers[14 + 2 * n])
    made: dict[str, Any] = {"response": "peak_oriented"} if kind == "IMKPeakOriented" else {}
    made["stiffness_n_per_m"] = stiffness * force / disp

    def side(i: int, strength: float) -> dict[str, float]:
        return {
            "yield_force_n": abs(strength) * force,
            "capping_ratio": caps[i],
            "plastic_disp_m": abs(plastic[i]) * disp,
            "post_capping_disp_m": abs(post[i]) * disp,
            "ultimate_disp_m": abs(ultimate[i]) * disp,
            "residual_ratio": abs(residual[i]),
            "deterioration_factor": factor[i],
        }

    made.update(side(0, strength))
    for name, capacity, exponent in zip(order, lambdas, exponents):
        if capacity and (name != "reloading" or kind == "IMKPeakOriented"):
            made[f"{name}_lambda_m"] = capacity * disp
            made[f"{name}_exponent"] = exponent
    negative = {key: value for key, value in side(1, strength_negative).items() if value != made[key]}
    if negative:
        made["negative"] = negative
    return made


def corners(numbers: list[float], disp: float, force: float) -> list[dict[str, float]]:
    """Corners of an envelope, positive in both directions, from pairs of force and displacement."""
    return [{"disp_m": abs(numbers[i + 1]) * disp, "force_n": abs(numbers[i]) * force} for i in range(0, len(numbers), 2)]


def hysteretic(args: list[Any], disp: float, force: float) -> dict[str, Any]:
    numbers = given(args, 12)
    points = 6 if len(numbers) >= 16 else 4
    sides = [corners(numbers[i * points : (i + 1) * points], disp, force) for i in (0, 1)]
    pinch_x, pinch_y, damage_1, damage_2, *beta = numbers[2 * points :]
    made: dict[str, Any] = {"positive": sides[0]}
    if sides[1] != sides[0]:
        made["negative"] = sides[1]
    return {
        **made,
        "pinch_x": pinch_x,
        "pinch_y": pinch_y,
        "damage_1": damage_1,
        "damage_2": damage_2,
        "beta": beta[0] if beta else 0.0,
    }


def pinching4(args: list[Any], disp: float, force: float) -> dict[str, Any]:
    numbers = given(args, 27)
    words = [value for value in args[2:] if isinstance(value, str)]
    sides = [corners(numbers[:8], disp, force)]
    rest = numbers[8:]
    if len(numbers) >= 38:
        sides.append(corners(numbers[8:16], disp, force))
        rest = numbers[16:]
    pinch = [dict(zip(("r_disp", "r_force", "u_force"), rest[i : i + 3])) for i in (0, 3)]
    damage = rest[6:] if len(sides) == 2 else rest[3:]
    made: dict[str, Any] = {"positive": sides[0], "pinching": pinch[0]}
    if len(sides) == 2:
        made["negative"] = sides[1]
        made["negative_pinching"] = pinch[1]
    made.update({"g_k": damage[:5], "g_d": damage[5:10], "g_f": damage[10:15], "g_e": damage[15]})
    if [word.lower() for word in words[:1]] == ["cycle"]:
        made["damage"] = "cycle"
    return made


def mirrored(made: dict[str, Any]) -> dict[str, Any]:
    """A law with both directions exchanged."""
    (kind, of), *_ = made.items()
    if kind == "imk" and "negative" in of:
        negative = of["negative"]
        swapped = {**of, **negative, "negative": {key: of[key] for key in negative}}
        # Λ refers to the yield force of the positive direction.
        scale = of["yield_force_n"] / swapped["yield_force_n"]
        swapped.update({key: value * scale for key, value in of.items() if key.endswith("_lambda_m")})
        return {kind: swapped}
    if "negative" in of:
        swapped = {**of, "positive": of["negative"], "negative": of["positive"]}
        if "negative_pinching" in of:
            swapped.update({"pinching": of["negative_pinching"], "negative_pinching": of["pinching"]})
        return {kind: swapped}
    return made
