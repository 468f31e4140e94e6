//! Curves of a test at its Δt and λ: errors over Ω with the modes on them, and growth over the delay of a specimen.

use super::analysis::ModeFacts;
use super::spectrum::{CriticalDelays, Spectrum};
use gusset_numerics::spectral::delay::{DiscreteLimit, recursion};
use gusset_numerics::spectral::{Apparent, Locus, spectral_radius};

/// One curve, or the dots on it.
#[derive(Debug)]
pub struct Curve {
    /// Its label.
    pub label: String,
    /// Across.
    pub x: Vec<f64>,
    /// Up; NaN where the curve has no value.
    pub y: Vec<f64>,
    /// Dots instead of a line.
    pub dots: bool,
}

/// Curves with common axes.
#[derive(Debug)]
pub struct Diagram {
    /// Short name, for a file.
    pub name: String,
    /// Title.
    pub title: &'static str,
    /// Quantity and unit across.
    pub across: (&'static str, &'static str),
    /// Quantity and unit up.
    pub up: (&'static str, &'static str),
    /// The curves.
    pub curves: Vec<Curve>,
}

impl Curve {
    fn line(label: String, x: Vec<f64>, y: Vec<f64>) -> Self {
        let dots = false;
        Self { label, x, y, dots }
    }

    fn dots(label: &str, x: Vec<f64>, y: Vec<f64>) -> Self {
        let (label, dots) = (label.to_owned(), true);
        Self { label, x, y, dots }
    }
}

/// Errors over Ω with the modes on them, and the spectral radius over the delay of each specimen. Empty for a method outside
/// the family.
#[must_use]
pub fn diagrams(spectrum: &Spectrum) -> Vec<Diagram> {
    let Some(lambda) = spectrum.lambda else {
        return Vec::new();
    };
    let swinging: Vec<&ModeFacts> = spectrum
        .modes
        .iter()
        .filter(|mode| mode.frequency > 0.0 && mode.apparent.is_some())
        .collect();
    let last = swinging
        .iter()
        .map(|mode| mode.frequency * spectrum.dt)
        .fold(0.05, f64::max);
    let omegas: Vec<f64> = (1..=300)
        .map(|i| 1.05 * last * f64::from(i) / 300.0)
        .collect();
    let ratio = swinging.first().map_or(0.0, |mode| mode.ratio);
    // One degree of freedom with the first mode's damping ratio, m = Δt = 1.
    let apparent = |omega: f64| {
        let locus = Locus {
            mass: 1.0,
            damping: 2.0 * ratio * omega,
            stiffness: omega * omega,
            dt: 1.0,
            lambda,
        };
        Apparent::of(locus.roots(omega * omega)[0])
    };
    let curve = |of: &dyn Fn(f64, Apparent) -> f64| {
        let y = omegas
            .iter()
            .map(|&omega| apparent(omega).map_or(f64::NAN, |apparent| of(omega, apparent)));
        Curve::line(
            format!("λ = {lambda}, ξ = {ratio:.4}"),
            omegas.clone(),
            y.collect(),
        )
    };
    let dots = |of: &dyn Fn(&ModeFacts) -> Option<f64>| {
        Curve::dots(
            "modes of this structure",
            swinging
                .iter()
                .map(|mode| mode.frequency * spectrum.dt)
                .collect(),
            swinging
                .iter()
                .map(|mode| of(mode).unwrap_or(f64::NAN))
                .collect(),
        )
    };
    let diagram = |name: &str, title, up, curves| Diagram {
        name: name.to_owned(),
        title,
        across: ("Ω = ω Δt", "1"),
        up: (up, "1"),
        curves,
    };
    let percent = 100.0;
    let mut all = vec![
        diagram(
            "period-error",
            "Period error",
            "T̄/T − 1 in %",
            vec![
                curve(&|omega, found| percent * (omega / found.omega - 1.0)),
                dots(&|mode| mode.period_error(spectrum.dt).map(|e| percent * e)),
            ],
        ),
        diagram(
            "damping-error",
            "Damping error",
            "apparent − true damping in % of critical",
            vec![
                curve(&|_, found| percent * (found.ratio - ratio)),
                dots(&|mode| mode.damping_error().map(|e| percent * e)),
            ],
        ),
    ];
    let delays = spectrum.delays.iter().enumerate();
    all.extend(delays.map(|(index, delay)| Diagram {
        name: format!("delay-{}", index + 1),
        title: "Growth per step over the delay of the specimen",
        across: ("delay", "s"),
        up: ("spectral radius − 1", "1"),
        curves: growth(spectrum, delay, lambda),
    }));
    all
}

/// Spectral radius of the recursion over the delay, to twice the critical one.
fn growth(spectrum: &Spectrum, delay: &CriticalDelays, lambda: f64) -> Vec<Curve> {
    let critical = match (&delay.discrete, &delay.continuous) {
        (Some(Ok(DiscreteLimit::At(tau))), _) => *tau,
        (_, Ok(Some(found))) => found.delay,
        _ => 8.0 * spectrum.dt,
    };
    let last = (2.0 * critical).clamp(spectrum.dt, 96.0 * spectrum.dt);
    let delays: Vec<f64> = (0..=60).map(|i| last * f64::from(i) / 60.0).collect();
    let radius = |tau: &f64| {
        let step = recursion(&delay.specimen.system, spectrum.dt, lambda, *tau).ok();
        step.and_then(|step| spectral_radius(&step))
            .map_or(f64::NAN, |radius| radius - 1.0)
    };
    let growth = delays.iter().map(radius).collect();
    let mut series = vec![Curve::line(
        format!("{}, λ = {lambda}", delay.specimen.name),
        delays,
        growth,
    )];
    if let Ok(Some(found)) = &delay.continuous {
        series.push(Curve::dots("continuous time", vec![found.delay], vec![0.0]));
    }
    if let Some(Ok(DiscreteLimit::At(tau))) = &delay.discrete {
        series.push(Curve::dots("recursion", vec![*tau], vec![0.0]));
    }
    series
}
