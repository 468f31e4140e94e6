//! The curves of `gusset check --plot`: errors over Ω with the modes on them, growth over the delay of a specimen.

use std::path::Path;

use anyhow::Context;

use super::{Delay, Spectrum};
use crate::record::make_free;
use crate::spectral::delay::{DiscreteLimit, recursion};
use crate::spectral::{Apparent, Locus, spectral_radius};
use crate::stability::ModeFacts;
use crate::verify::{Figure, Scale, Series};

impl Spectrum {
    /// Writes the curves into a new folder: errors over Ω with the modes on them, spectral radius over delay.
    pub(in crate::cli) fn plot(&self, folder: &Path) -> anyhow::Result<()> {
        make_free(folder).context("--plot")?;
        for (name, figure) in self.figures() {
            for (ending, text) in [("svg", figure.svg(false)), ("csv", figure.csv())] {
                let path = folder.join(format!("{name}.{ending}"));
                crate::record::atomic::write(&path, text.as_bytes())
                    .with_context(|| path.display().to_string())?;
            }
        }
        Ok(())
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        let Some(lambda) = self.lambda else {
            return Vec::new();
        };
        let swinging: Vec<&ModeFacts> = self
            .modes
            .iter()
            .filter(|mode| mode.frequency > 0.0 && mode.apparent.is_some())
            .collect();
        let last = swinging
            .iter()
            .map(|mode| mode.frequency * self.dt)
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
            Series::line(
                format!("λ = {lambda}, ξ = {ratio:.4}"),
                omegas.clone(),
                y.collect(),
            )
        };
        let dots = |of: &dyn Fn(&ModeFacts) -> Option<f64>| {
            Series::dots(
                "modes of this structure",
                swinging
                    .iter()
                    .map(|mode| mode.frequency * self.dt)
                    .collect(),
                swinging
                    .iter()
                    .map(|mode| of(mode).unwrap_or(f64::NAN))
                    .collect(),
            )
        };
        let figure = |title, up, series| Figure {
            file: "",
            title,
            claim: "",
            across: Scale::free("Ω = ω Δt", "1"),
            up: Scale::free(up, "1"),
            logarithmic: false,
            square: false,
            series,
        };
        let percent = 100.0;
        let mut figures = vec![
            (
                "period-error".to_owned(),
                figure(
                    "Period error",
                    "T̄/T − 1 in %",
                    vec![
                        curve(&|omega, found| percent * (omega / found.omega - 1.0)),
                        dots(&|mode| mode.period_error(self.dt).map(|e| percent * e)),
                    ],
                ),
            ),
            (
                "damping-error".to_owned(),
                figure(
                    "Damping error",
                    "apparent − true damping in % of critical",
                    vec![
                        curve(&|_, found| percent * (found.ratio - ratio)),
                        dots(&|mode| mode.damping_error().map(|e| percent * e)),
                    ],
                ),
            ),
        ];
        for (index, delay) in self.delays.iter().enumerate() {
            figures.push((format!("delay-{}", index + 1), self.growth(delay, lambda)));
        }
        figures
    }

    /// Spectral radius of the recursion over the delay, to twice the critical one.
    fn growth(&self, delay: &Delay, lambda: f64) -> Figure {
        let critical = match (&delay.discrete, &delay.continuous) {
            (Some(Ok(DiscreteLimit::At(tau))), _) => *tau,
            (_, Ok(Some(found))) => found.delay,
            _ => 8.0 * self.dt,
        };
        let last = (2.0 * critical).clamp(self.dt, 96.0 * self.dt);
        let delays: Vec<f64> = (0..=60).map(|i| last * f64::from(i) / 60.0).collect();
        let radius = |tau: &f64| {
            let step = recursion(&delay.specimen.system, self.dt, lambda, *tau).ok();
            step.and_then(|step| spectral_radius(&step))
                .map_or(f64::NAN, |radius| radius - 1.0)
        };
        let growth = delays.iter().map(radius).collect();
        let mut series = vec![Series::line(
            format!("{}, λ = {lambda}", delay.specimen.name),
            delays,
            growth,
        )];
        if let Ok(Some(found)) = &delay.continuous {
            series.push(Series::dots(
                "continuous time",
                vec![found.delay],
                vec![0.0],
            ));
        }
        if let Some(Ok(DiscreteLimit::At(tau))) = &delay.discrete {
            series.push(Series::dots("recursion", vec![*tau], vec![0.0]));
        }
        Figure {
            file: "",
            title: "Growth per step over the delay of the specimen",
            claim: "",
            across: Scale::free("delay", "s"),
            up: Scale::free("spectral radius − 1", "1"),
            logarithmic: false,
            square: false,
            series,
        }
    }
}
