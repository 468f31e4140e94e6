//! Whether two ends agree, and if not, on what.

use super::{
    Axis, Hello, Refuse, RefuseCode, Sampling, TEXT_LIMIT, Versions, Welcome, layout_hash,
};
use crate::{Side, WireError};

/// Terms that a server offers; the controller's Hello must fit them.
#[derive(Debug, Clone, PartialEq)]
pub struct Terms {
    /// Versions spoken.
    pub versions: Versions,
    /// The axes, with the specimen's own limits.
    pub axes: Vec<Axis>,
    /// Most commands per second.
    pub rate_max_hz: f64,
    /// Longest watchdog time that the specimen's end accepts, s.
    pub watchdog_max_s: f64,
    /// True if the force can be sampled at a given part of the period and not only at once.
    pub timed_sampling: bool,
    /// True if frames must be signed; false if they must not be.
    pub keyed: bool,
}

/// The specimen's judgement on a Hello: the version to speak, or the refusal to send. The proof is checked apart
/// (and first), by [`super::verify_hello`].
///
/// # Errors
/// A [`Refuse`] that says what differs.
pub fn agree(hello: &Hello, terms: &Terms) -> Result<u16, Refuse> {
    let refuse = |code, mut text: String| {
        // A number may print with hundreds of digits; a refusal must always be fit to send.
        while text.len() > TEXT_LIMIT {
            text.pop();
        }
        Refuse {
            code,
            versions: terms.versions,
            text,
        }
    };
    let version = common(hello.versions, terms.versions).ok_or_else(|| {
        refuse(
            RefuseCode::Version,
            format!(
                "protocol versions {} to {} wanted, {} to {} found",
                terms.versions.lowest,
                terms.versions.highest,
                hello.versions.lowest,
                hello.versions.highest
            ),
        )
    })?;
    if hello.keyed != terms.keyed {
        let text = if terms.keyed {
            "a pre-shared key is wanted"
        } else {
            "no pre-shared key is configured here"
        };
        return Err(refuse(RefuseCode::Key, text.to_owned()));
    }
    same_axes(hello, terms).map_err(|(code, text)| refuse(code, text))?;
    if hello.layout != layout_hash(&terms.axes) {
        return Err(refuse(
            RefuseCode::Layout,
            "the layout hash differs although axes and units agree".to_owned(),
        ));
    }
    let rate_hz = hello.rate_numerator as f64 / hello.rate_denominator as f64;
    if !(rate_hz > 0.0 && rate_hz <= terms.rate_max_hz) {
        let text = format!(
            "{rate_hz} commands per second, at most {}",
            terms.rate_max_hz
        );
        return Err(refuse(RefuseCode::Rate, text));
    }
    if let Some(wider) = wider(&terms.axes, &hello.axes) {
        let Wider {
            what,
            promised,
            own,
            unit,
            ..
        } = wider;
        let text = format!(
            "{what}: the test allows {promised} {unit}, the specimen's end only {own} {unit}"
        );
        return Err(refuse(RefuseCode::Limits, text));
    }
    let period_s = 1.0 / rate_hz;
    if !(hello.watchdog_s >= period_s && hello.watchdog_s <= terms.watchdog_max_s) {
        let text = format!(
            "watchdog time {} s, {period_s} (one period) to {} s wanted",
            hello.watchdog_s, terms.watchdog_max_s
        );
        return Err(refuse(RefuseCode::Watchdog, text));
    }
    if hello.sampling != Sampling::Reply && !terms.timed_sampling {
        return Err(refuse(
            RefuseCode::Sampling,
            "the force is sampled when the command comes, not later".to_owned(),
        ));
    }
    Ok(version)
}

/// The controller's check of a Welcome against its own Hello: the server must have accepted it unchanged. [`wider`]
/// compares the limits, and [`super::verify_welcome`] checks the proof.
///
/// # Errors
/// What differs.
pub fn check_welcome(hello: &Hello, welcome: &Welcome) -> Result<(), WireError> {
    let (lowest, highest) = (hello.versions.lowest, hello.versions.highest);
    if !(lowest..=highest).contains(&welcome.version) {
        return Err(WireError::Version {
            lowest,
            highest,
            found: welcome.version,
        });
    }
    if hello.keyed != welcome.keyed {
        return Err(WireError::Keyed {
            expected: hello.keyed,
            found: welcome.keyed,
        });
    }
    crate::bytes::same_length("axes of the specimen", hello.axes.len(), welcome.axes.len())?;
    let same = hello.axes.iter().zip(&welcome.axes).all(|(mine, theirs)| {
        mine.name == theirs.name
            && mine.disp_unit == theirs.disp_unit
            && mine.force_unit == theirs.force_unit
    });
    if !same || hello.layout != welcome.layout || welcome.layout != layout_hash(&welcome.axes) {
        return Err(WireError::Order {
            expected: "the layout of the hello",
            found: "another layout",
        });
    }
    if hello.sampling != welcome.sampling {
        return Err(WireError::Order {
            expected: "the sampling moment of the hello",
            found: "another moment",
        });
    }
    // Written as "is inside", so that NaN fails.
    let in_time = welcome.watchdog_s <= hello.watchdog_s;
    if !in_time {
        return Err(WireError::Order {
            expected: "a watchdog as short as in the hello",
            found: "a longer one",
        });
    }
    if welcome.keyed && welcome.nonce == hello.nonce {
        // A specimen that sends our own nonce back lets us choose the whole key.
        return Err(WireError::Proof {
            found: Side::Specimen,
        });
    }
    Ok(())
}

fn common(a: Versions, b: Versions) -> Option<u16> {
    let highest = a.highest.min(b.highest);
    (highest >= a.lowest.max(b.lowest)).then_some(highest)
}

fn same_axes(hello: &Hello, terms: &Terms) -> Result<(), (RefuseCode, String)> {
    let (wanted, found) = (terms.axes.len(), hello.axes.len());
    if wanted != found {
        return Err((
            RefuseCode::Axes,
            format!("{wanted} axes wanted, {found} found"),
        ));
    }
    for (index, (mine, theirs)) in terms.axes.iter().zip(&hello.axes).enumerate() {
        let number = index + 1;
        if mine.name != theirs.name {
            return Err((
                RefuseCode::Axes,
                format!(
                    "axis {number} is called '{}' here, '{}' there",
                    mine.name, theirs.name
                ),
            ));
        }
        if (mine.disp_unit, mine.force_unit) != (theirs.disp_unit, theirs.force_unit) {
            return Err((
                RefuseCode::Units,
                format!(
                    "axis {number} is in {} and {} here, in {} and {} there",
                    mine.disp_unit.symbol(),
                    mine.force_unit.symbol(),
                    theirs.disp_unit.symbol(),
                    theirs.force_unit.symbol()
                ),
            ));
        }
    }
    Ok(())
}

/// A limit of the controller's that goes beyond the specimen's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wider {
    /// Axis, from 0.
    pub axis: usize,
    /// The limit, in words.
    pub what: &'static str,
    /// The controller's.
    pub promised: f64,
    /// The specimen's own.
    pub own: f64,
    /// Unit of both.
    pub unit: &'static str,
}

/// Limits that differ by this share of the larger are equal, converted from different units.
const ROUNDING: f64 = 1e-9;

/// Compares the limits that the controller promises with those of the specimen, and returns the first that is wider. A
/// limit that the controller does not promise (infinite) is kept by the specimen alone.
#[must_use]
pub fn wider(specimen: &[Axis], controller: &[Axis]) -> Option<Wider> {
    let mut axes = specimen.iter().zip(controller).enumerate();
    axes.find_map(|(axis, (specimen, controller))| {
        let (own, promised) = (specimen.limits, controller.limits);
        let unit = specimen.disp_unit.symbol();
        let cases = [
            // It is a largest one, the other way.
            (
                "smallest displacement",
                -1.0,
                promised.disp_min,
                own.disp_min,
                unit,
            ),
            (
                "largest displacement",
                1.0,
                promised.disp_max,
                own.disp_max,
                unit,
            ),
            (
                "largest speed per second",
                1.0,
                promised.speed_max,
                own.speed_max,
                unit,
            ),
            (
                "largest force",
                1.0,
                promised.force_max,
                own.force_max,
                specimen.force_unit.symbol(),
            ),
        ];
        cases
            .into_iter()
            .find_map(|(what, way, promised, own, unit)| {
                let slack = ROUNDING * promised.abs().max(own.abs());
                let inside = way * (promised - own) <= slack;
                (promised.is_finite() && !inside).then_some(Wider {
                    axis,
                    what,
                    promised,
                    own,
                    unit,
                })
            })
    })
}
