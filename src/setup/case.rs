//! A prepared test as its verdict sees it.

use super::Prepared;
use gusset_config::{ClockChoice, IntegratorTable, SafetyTable, SpecimenTable};
use gusset_proof::{Accepts, Actuator, Case, Machine};

impl Prepared {
    /// Input of its verdict; `None` for a trial, and for a loop that has no file.
    #[must_use]
    pub fn case(&self) -> Option<Case<'_>> {
        let file = &self.loaded.as_ref()?.file;
        let facts = &self.facts;
        let structure = facts.structure.as_ref();
        let tables = file.specimen.iter().enumerate();
        Some(Case {
            real_clock: facts.clock == ClockChoice::Real,
            dt: facts.dt,
            tick: facts.rate_hz.recip(),
            structure: structure.is_some(),
            lambda: facts.lambda(),
            analysis: structure.and_then(|structure| structure.analysis.as_ref()),
            actuators: tables
                .map(|(number, table)| actuator(number, table, facts.rate_hz.recip()))
                .collect(),
            doubts: &self.doubts,
            accepts: accepts(&file.safety, &file.integrator),
        })
    }
}

fn actuator(number: usize, table: &SpecimenTable, tick: f64) -> Actuator {
    let machine = table.link.as_ref().map(|link| Machine {
        computed: link.computed,
        forces_only: table.force_only_link().is_some(),
    });
    Actuator {
        number,
        name: table.name.clone(),
        key: decides(table),
        transfer: table.transfer_in_the_loop(1.0, tick),
        compensation: table.compensation.clone(),
        delay_std_s: table
            .identified
            .and_then(|known| known.delay_std_s)
            .unwrap_or(0.0),
        link: machine,
    }
}

/// Key that decides how a specimen follows: the compensation, or else the actuator.
const fn decides(table: &SpecimenTable) -> &'static str {
    match (&table.compensation, &table.link, &table.transfer) {
        (Some(_), _, _) => "compensation",
        (None, None, _) | (None, Some(_), Some(_)) => "transfer",
        (None, Some(_), None) => "identified",
    }
}

/// The reasons for which errors are accepted. An older key accepts an unstable λ without a reason.
fn accepts(safety: &SafetyTable, integrator: &IntegratorTable) -> Accepts {
    let older = || "allow_unstable_lambda = true in [integrator]".to_owned();
    let unstable = safety.accept_unstable.clone();
    Accepts {
        unstable: unstable.or_else(|| integrator.allow_unstable_lambda.then(older)),
        trip: safety.accept_trip.clone(),
        speed: safety.accept_speed.clone(),
        error: safety.accept_error.clone(),
    }
}
