//! From `[specimen.link]` to a link that is ready to connect. Nothing is connected here; files are read.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::remote::remote_settings;
use super::{Refused, Site};
use gusset_config::{
    Carrier, ClockChoice, Finding, KeyPath, LinkCoupling, LinkSpec, SpecimenTable, StaleChoice,
    TestFile, TlsSpec, WATCHDOG_MAX_S,
};
use gusset_control::port::limits::AxisLimits;
use gusset_control::port::{OnStale, Pace, WaitRules, WiringCheck};
use gusset_link::announce::announce;
use gusset_link::openfresco::{Remote, RemoteSettings};
use gusset_link::secret::read_key;
use gusset_link::tls::{TlsClient, TlsFiles};
use gusset_link::{NativeLink, NativeSetup, SocketOptions, Wait};
use gusset_quantity::substructure::Coupling;
use gusset_quantity::time::Ratio;
use gusset_quantity::units::AxisUnits;
use gusset_record::rt::throttle::Throttle;
use gusset_wire::handshake::{Axis, Limits, Sampling, Unit};
use gusset_wire::key::PreSharedKey;

/// Default silence after which a specimen must hold: in s, and in ticks.
const WATCHDOG_S: f64 = 0.25;
const WATCHDOG_TICKS: f64 = 10.0;

/// Busy loop before the deadline of a measurement that stays away, in ns: a thread that sleeps there wakes up to 50 µs
/// late, and the deadline is only an eighth of a tick before the edge.
const LAST_SPIN_NS: u64 = 50_000;

/// How the wiring of a specimen behind a link is checked. `gears`: metres at the specimen in the port's unit of displacement of each axis.
/// The estimate of the stiffness is by rows, with the reason to accept another one; `period_s` is the time from exchange to exchange, and
/// `units` are those of messages.
pub(super) fn wiring_check(
    link: &LinkSpec,
    gears: impl Iterator<Item = f64>,
    (stiffness, accepted): (Vec<f64>, Option<String>),
    period_s: f64,
    units: Vec<AxisUnits>,
) -> WiringCheck {
    match (link.probe_m, link.probe) {
        (Some(metres), _) => WiringCheck::Probe {
            amplitude: gears.map(|gear| metres / gear.abs()).collect(),
            stiffness,
            accepted,
            pace: Pace::of(link.probe_ramp_s, period_s),
            units,
        },
        (None, Some(_)) => WiringCheck::Known,
        (None, None) => WiringCheck::Unchecked,
    }
}

/// A link that speaks our own protocol, and how it is waited for.
pub(super) fn native(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
    link: &LinkSpec,
    axes: usize,
) -> Result<(NativeLink, WaitRules), Refused> {
    let time = site.loaded.time;
    let key = shared_key(link, at, &site.loaded.path).or_else(|found| site.refuse(*found))?;
    // A socket has a separate wall clock: under the simulated clock the test waits for each answer.
    let coupling = match (link.coupling, time.clock) {
        (LinkCoupling::Sampled, ClockChoice::Real) => Coupling::Sampled,
        _ => Coupling::Lockstep,
    };
    // A per-step partner counts steps.
    let ticks = time.ticks_between_commands(link);
    let period_s = time.between_commands_s(link);
    let (per_second, seconds) = time.period.inverse().terms();
    let usual = native_setup(link, key, wire_axes(table, axes, Some(time.period.value())));
    let mut options = usual.options;
    if coupling == Coupling::Sampled {
        let period_ns = (period_s * 1e9) as u64;
        let asked_ns = site.loaded.file.timing.spin_ns();
        let pacer_ns = Throttle::USUAL.fit_spin(asked_ns, period_ns);
        options.wait = fitted(options.wait, period_ns, pacer_ns);
    }
    let setup = NativeSetup {
        test: site.loaded.file.title.clone(),
        rate: Ratio::new(per_second, seconds.saturating_mul(ticks.into()))
            .map_or((per_second, seconds), Ratio::terms),
        watchdog_s: watchdog_s(link, period_s),
        coupling,
        options,
        ..usual
    };
    let tls = tls_client(link, at, &site.loaded.path).or_else(|found| site.refuse(*found))?;
    let native = match tls {
        Some(tls) => NativeLink::over_tls(setup, tls),
        None => match &mut site.dial {
            Some(dial) => {
                let wire = dial(&setup);
                NativeLink::over(setup, wire)
            }
            None => NativeLink::new(setup),
        },
    };
    Ok((native, rules(link, time.period.value())))
}

/// Silence in s after which the specimen must hold, commanded every `period_s`.
pub(super) fn watchdog_s(link: &LinkSpec, period_s: f64) -> f64 {
    link.watchdog_s
        .unwrap_or_else(|| WATCHDOG_S.max((WATCHDOG_TICKS * period_s).min(WATCHDOG_MAX_S)))
}

/// Both waits of a tick, for the edge and for the reply, must leave the kernel its share of the processor: 85 % are for
/// them, a tenth for the work.
fn fitted(wait: Wait, period_ns: u64, pacer_ns: u64) -> Wait {
    let room = (period_ns / 100 * 85).saturating_sub(pacer_ns);
    let spin_last_ns = LAST_SPIN_NS.min(room / 4);
    Wait {
        spin_first_ns: wait.spin_first_ns.min(room - spin_last_ns),
        spin_last_ns,
    }
}

/// The key that a link names; `None` without one. `at` is the specimen of the file `test`.
pub(super) fn shared_key(
    link: &LinkSpec,
    at: &KeyPath,
    test: &Path,
) -> Result<Option<PreSharedKey>, Box<Finding>> {
    let read = |file: &String| read_key(&beside(test, file));
    let key = link.key_file.as_ref().map(read).transpose();
    key.map_err(|error| {
        let at = at.key("link").key("key_file");
        Box::new(Finding::error(at, error.to_string()))
    })
}

/// Our certificate and the trusted authorities over TLS; `None` over any other transport. `at` is the specimen of the file `test`.
pub(super) fn tls_client(
    link: &LinkSpec,
    at: &KeyPath,
    test: &Path,
) -> Result<Option<TlsClient>, Box<Finding>> {
    if link.transport != Carrier::Tls {
        return Ok(None);
    }
    let spec = link.tls.clone().unwrap_or_default();
    let files = TlsFiles::of_client(&spec, &folder(test));
    let client = TlsClient::new(&files, spec.server_name.as_deref(), spec.check_name);
    client.map(Some).map_err(|error| {
        let at = at.key("link").key("tls").key(error.key);
        Box::new(Finding::error(at, format!("`{}`: {error}", error.key)))
    })
}

/// Set-up from the link alone: a lockstep link of no particular test, 100 commands a second.
pub(super) fn native_setup(
    link: &LinkSpec,
    key: Option<PreSharedKey>,
    axes: Vec<Axis>,
) -> NativeSetup {
    NativeSetup {
        address: link.address.clone(),
        carrier: link.transport,
        key,
        test: String::new(),
        axes,
        rate: (100, 1),
        watchdog_s: link.watchdog_s.unwrap_or(WATCHDOG_S),
        sampling: link
            .sample_after
            .map_or(Sampling::Reply, Sampling::Fraction),
        coupling: Coupling::Lockstep,
        connect_limit: seconds(link.connect_timeout_s),
        reply_timeout: seconds(link.reply_timeout_s),
        options: SocketOptions {
            wait: Wait {
                spin_first_ns: (link.spin_us * 1e3) as u64,
                spin_last_ns: 0,
            },
            ..SocketOptions::default()
        },
    }
}

/// A specimen behind OpenFresco or OpenSees, and how it is waited for: always in lockstep.
pub(super) fn openfresco(
    site: &mut Site<'_>,
    at: &KeyPath,
    link: &LinkSpec,
    axes: usize,
) -> Result<(Remote, WaitRules), Refused> {
    let settings = openfresco_client(link, at, &site.loaded.path, axes);
    let settings = settings.or_else(|found| site.refuse(*found))?;
    let remote = Remote::new(settings)
        .or_else(|error| site.refuse_key(&at.key("link"), error.key(), &error))?;
    Ok((remote, rules(link, site.loaded.time.period.value())))
}

/// The client of a link to OpenFresco or OpenSees. `at` is the specimen of the file `test`.
pub(super) fn openfresco_client(
    link: &LinkSpec,
    at: &KeyPath,
    test: &Path,
    axes: usize,
) -> Result<RemoteSettings, Box<Finding>> {
    let tls = tls_client(link, at, test)?;
    let tls = tls.map(|tls| tls.with_record_limit(seconds(link.reply_timeout_s)));
    let settings = remote_settings(link, axes).ok_or_else(|| {
        let text = "the protocol of Gusset has no OpenFresco settings";
        Box::new(Finding::error(at.key("link").key("protocol"), text))
    })?;
    Ok(RemoteSettings { tls, ..settings })
}

fn rules(link: &LinkSpec, period: f64) -> WaitRules {
    WaitRules {
        reply_timeout_ns: (link.reply_timeout_s * 1e9) as u64,
        on_stale: match link.on_stale {
            StaleChoice::Hold => OnStale::Hold,
            StaleChoice::Extrapolate => OnStale::Extrapolate,
            StaleChoice::Stop => OnStale::Stop,
        },
        stale_in_a_row: link.stale_bound(period),
        has_clock: false,
    }
}

/// The axes as our own protocol names them, with the limits that our loop keeps, whose ticks are at least `tick_s` long if
/// that is known. Units that it has not were refused before.
pub(super) fn wire_axes(table: &SpecimenTable, axes: usize, tick_s: Option<f64>) -> Vec<Axis> {
    let names = table
        .link
        .as_ref()
        .and_then(|link| link.axis_names.as_ref());
    let (limits, units) = (table.limits_of(axes), table.units_of(axes));
    (0..axes)
        .map(|index| {
            let gear = table.axis.get(index).cloned().unwrap_or_default();
            let name = names
                .and_then(|names| names.get(index).cloned())
                .unwrap_or_else(|| format!("axis {}", index + 1));
            // Units that this protocol lacks are refused before anything is sent over it.
            let disp = gear.unit_disp.row().wire.unwrap_or(Unit::Metre);
            let force = gear.unit_force.row().wire.unwrap_or(Unit::Newton);
            let limits = match (limits.get(index), units.get(index)) {
                (Some(spec), Some(units)) => announce(&AxisLimits::of(spec), units, tick_s),
                _ => Limits::NONE,
            };
            Axis {
                name,
                disp_unit: disp,
                force_unit: force,
                limits,
            }
        })
        .collect()
}

/// The configuration for the run folder: a key is never copied there, so it gets a path that is valid from anywhere; so
/// do certificates.
pub(super) fn with_keys_from_anywhere(file: &TestFile, test: &Path) -> TestFile {
    let mut named = file.clone();
    for link in named.specimen.iter_mut().filter_map(|s| s.link.as_mut()) {
        if let Some(key) = &mut link.key_file {
            *key = beside(test, key).display().to_string();
        }
        if link.transport == Carrier::Tls {
            let spec = link.tls.take().unwrap_or_default();
            let files = TlsFiles::of_client(&spec, &folder(test));
            link.tls = Some(TlsSpec {
                certificate_file: Some(files.certificate.display().to_string()),
                key_file: Some(files.key.display().to_string()),
                ca_file: Some(files.ca.display().to_string()),
                ..spec
            });
        }
    }
    named
}

pub(super) fn folder(test: &Path) -> PathBuf {
    test.parent().unwrap_or(Path::new("")).to_owned()
}

/// A file that is named relative to the test file, and stays where it is.
pub(super) fn beside(test: &Path, file: &str) -> PathBuf {
    let path = test.parent().unwrap_or(Path::new("")).join(file);
    std::path::absolute(&path).unwrap_or(path)
}

/// Positive: checked before.
pub(super) fn seconds(value: f64) -> Duration {
    Duration::try_from_secs_f64(value).unwrap_or(Duration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tick_waits_leave_the_kernel_its_share() {
        let asked = Wait::default();
        for (rate_hz, first_us, last_us) in [
            (1000, 60, 50),
            (4096, 60, 36),
            (10_000, 18, 6),
            (20_000, 7, 2),
        ] {
            let period_ns = 1_000_000_000 / rate_hz;
            let pacer_ns = Throttle::USUAL.fit_spin(60_000, period_ns);
            let wait = fitted(asked, period_ns, pacer_ns);
            let found = (wait.spin_first_ns / 1000, wait.spin_last_ns / 1000);
            assert_eq!(found, (first_us, last_us), "{rate_hz} Hz");
            let all = pacer_ns + wait.spin_first_ns + wait.spin_last_ns;
            assert!(all <= period_ns / 100 * 85);
        }
    }
}
