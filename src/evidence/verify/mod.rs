//! The published values of the family, recomputed by the program's own code and judged: Gui, Wang, Jin, Chen and Zhou
//! (2014), table by table, equation by equation, figure by figure.
//!
//! A [`Topic`] is a named piece of the paper. Proving it gives a [`Part`]: checks and the figures in the paper's axes.
//! Each check holds the paper's value, the value obtained, the tolerance and the verdict. Where the paper is loose or
//! inconsistent, the check is a [`Verdict::Note`] and judges the correct statement instead. Random systems come from
//! fixed seeds: two runs give the same text, timing apart.
//!
//! Nothing is written here: [`files`] gives the page, the pictures and their data as text.

mod accuracy;
mod chain;
mod cost;
mod criterion;
mod dense;
mod drive;
mod figure;
mod formulas;
mod linear;
mod nonlinear;
mod order;
mod page;
mod stability;
mod storeys;
mod tangents;
#[cfg(test)]
mod tests;

use serde::Serialize;
use thiserror::Error;

pub(crate) use chain::chain_of_example_4_3;
pub use figure::{Axes, Figure, Scale, Series};
pub use page::files;

use gusset_quantity::time::Clock;

/// Outcome of one check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As published, within the tolerance.
    Pass,
    /// Not as published.
    Fail,
    /// Not judged: a measurement of this machine, or a place where the paper is loose.
    Note,
}

/// One value or statement of the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Quantity or statement under check.
    pub what: String,
    /// The paper's value.
    pub paper: String,
    /// The value obtained.
    pub obtained: String,
    /// Allowed difference, or criterion.
    pub tolerance: String,
    /// Outcome.
    pub verdict: Verdict,
}

impl Check {
    /// A number that must lie within `tolerance` of the printed one.
    #[must_use]
    pub fn near(what: &str, paper: f64, obtained: f64, tolerance: f64) -> Self {
        Self {
            what: what.to_owned(),
            paper: number(paper),
            obtained: number(obtained),
            tolerance: format!("± {}", number(tolerance)),
            verdict: judged((obtained - paper).abs() <= tolerance),
        }
    }

    /// A deviation from what the paper says that must not exceed `bound`.
    #[must_use]
    pub(crate) fn within(what: &str, paper: &str, obtained: f64, bound: f64) -> Self {
        Self {
            what: what.to_owned(),
            paper: paper.to_owned(),
            obtained: number(obtained),
            tolerance: format!("at most {}", number(bound)),
            verdict: judged(obtained.abs() <= bound),
        }
    }

    /// A statement that holds or does not.
    #[must_use]
    pub(crate) fn holds(what: &str, paper: &str, obtained: String, how: &str, holds: bool) -> Self {
        Self {
            what: what.to_owned(),
            paper: paper.to_owned(),
            obtained,
            tolerance: how.to_owned(),
            verdict: judged(holds),
        }
    }

    /// A note without a verdict.
    #[must_use]
    pub(crate) fn note(what: &str, paper: &str, obtained: String, remark: &str) -> Self {
        Self {
            what: what.to_owned(),
            paper: paper.to_owned(),
            obtained,
            tolerance: remark.to_owned(),
            verdict: Verdict::Note,
        }
    }
}

fn judged(holds: bool) -> Verdict {
    if holds { Verdict::Pass } else { Verdict::Fail }
}

/// A number with up to six significant digits.
fn number(value: f64) -> String {
    let size = value.abs();
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.to_owned();
    }
    if value == 0.0 || value.is_nan() {
        return value.to_string();
    }
    let trimmed = |text: &str| text.trim_end_matches('0').trim_end_matches('.').to_owned();
    if !(1e-3..1e6).contains(&size) {
        let text = format!("{value:.2e}");
        return match text.split_once('e') {
            Some((digits, exponent)) => format!("{}e{exponent}", trimmed(digits)),
            None => text,
        };
    }
    let before = libm::floor(libm::log10(size)) as i32;
    let decimals = usize::try_from(5 - before).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        trimmed(&text)
    } else {
        text
    }
}

/// A table of the paper with the values obtained beside it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tabulation {
    /// Title of the table.
    pub title: String,
    /// Names of the columns; the first one names the rows.
    pub head: Vec<String>,
    /// One text per column.
    pub rows: Vec<Vec<String>>,
}

/// Outcome of one piece of the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Part {
    /// Name of its topic.
    pub name: &'static str,
    /// Title of the topic.
    pub title: &'static str,
    /// The paper's statement, in short.
    pub says: &'static str,
    /// Its values and statements.
    pub checks: Vec<Check>,
    /// Its tables.
    pub tables: Vec<Tabulation>,
    /// Its figures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

impl Part {
    /// Number of checks with this verdict.
    #[must_use]
    pub fn count(&self, verdict: Verdict) -> usize {
        let of_it = |check: &&Check| check.verdict == verdict;
        self.checks.iter().filter(of_it).count()
    }
}

/// True if no check of any part failed.
#[must_use]
pub fn all_hold(parts: &[Part]) -> bool {
    parts.iter().all(|part| part.count(Verdict::Fail) == 0)
}

/// How much work is put into the random systems and the large models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Seconds.
    Quick,
    /// Minutes.
    Whole,
}

impl Effort {
    /// Returns `quick` or `whole`, by the effort.
    fn of(self, quick: usize, whole: usize) -> usize {
        match self {
            Self::Quick => quick,
            Self::Whole => whole,
        }
    }
}

/// Checks and figures of a topic.
type Proof = (Vec<Check>, Vec<Figure>);

/// All that a topic shows.
struct Shown {
    checks: Vec<Check>,
    figures: Vec<Figure>,
    tables: Vec<Tabulation>,
}

impl From<Proof> for Shown {
    fn from((checks, figures): Proof) -> Self {
        Self {
            checks,
            figures,
            tables: Vec::new(),
        }
    }
}

/// A piece of the paper.
#[derive(Debug, Clone, Copy)]
pub struct Topic {
    /// Its name on the command line.
    pub name: &'static str,
    /// Title of the topic.
    pub title: &'static str,
    /// The paper's statement, in short.
    pub says: &'static str,
    prove: fn(Effort, &dyn Clock) -> Shown,
}

impl Topic {
    /// Does the work. `clock` times example 4.3 and nothing else.
    #[must_use]
    pub fn prove(&self, effort: Effort, clock: &dyn Clock) -> Part {
        let Shown {
            checks,
            figures,
            tables,
        } = (self.prove)(effort, clock);
        Part {
            name: self.name,
            title: self.title,
            says: self.says,
            checks,
            tables,
            figures,
        }
    }
}

/// All topics, in the order of the paper.
pub const TOPICS: [Topic; 15] = [
    Topic {
        name: "table-1",
        title: "Table 1 and equation (13): poles, and one α for all",
        says: "With the poles of Newmark's family put into the characteristic polynomial, α1 and α2 come out alike: (13). The subfamily with λ derives from Newmark with γ = 1/2, β = 1/λ; λ = 4 is the CR algorithm.",
        prove: |effort, _| formulas::table_1(effort).into(),
    },
    Topic {
        name: "transfer",
        title: "Equations (11) to (19): transfer function and amplification matrix",
        says: "Mapping poles and mapping eigenvalues come to the same: the poles of the discrete transfer function are the eigenvalues of the amplification matrix. For many degrees of freedom α becomes the matrix (18), (19).",
        prove: |effort, _| formulas::transfer(effort).into(),
    },
    Topic {
        name: "order",
        title: "Section 3.1: order of accuracy",
        says: "The paper infers second order from the poles, which are those of Newmark's family. True of the poles; of a trajectory only if it starts with zero acceleration, or with a corrected first step.",
        prove: |_, _| order::accuracy().into(),
    },
    Topic {
        name: "fig-1",
        title: "Fig. 1: amplitude decay",
        says: "No amplitude decays, because the algorithmic damping ratio of every member is 0.",
        prove: |_, _| accuracy::amplitude_decay().into(),
    },
    Topic {
        name: "fig-2",
        title: "Fig. 2: period elongation",
        says: "|PE| grows with Δt/T for one λ, and falls with growing λ for one Δt/T; the paper takes λ = 11.5 for the member that distorts the period about the least, whatever Δt/T.",
        prove: |_, _| accuracy::period_elongation().into(),
    },
    Topic {
        name: "fig-3",
        title: "Fig. 3: stable and unstable poles",
        says: "Stable as long as every pole is inside of or on the unit circle, unstable as soon as one is outside.",
        prove: |effort, _| stability::regions(effort).into(),
    },
    Topic {
        name: "eq-33",
        title: "Equations (27) to (33): the linear limit",
        says: "λ ≤ 4 is stable for every linear elastic structure and step; λ > 4 only up to Ω = √(4λ/(λ − 4)).",
        prove: |effort, _| stability::linear_limit(effort).into(),
    },
    Topic {
        name: "fig-4",
        title: "Fig. 4, equations (36) to (39): the closed loop",
        says: "With a tangent stiffness that has left the initial one, the algorithm is a closed loop: G′(z) made of the initial stiffness, fed back through H(z) = k_t. For a linear system (39) is (12) again.",
        prove: |effort, _| tangents::closed_loop(effort).into(),
    },
    Topic {
        name: "fig-5",
        title: "Fig. 5: root locus of a changed stiffness",
        says: "A branch of the locus leaves the unit circle at z = −1, so only a finite range of k_t is stable. ξ = 0.02, ω = 2π rad/s, Δt = 0.5 s, λ = 1.",
        prove: |_, _| tangents::root_locus().into(),
    },
    Topic {
        name: "eq-41",
        title: "Equations (40) and (41): changed tangents",
        says: "Softening: λ ≤ 4 stays stable whatever the step. Hardening: that range shrinks to λ ≤ 4 ω_0²/ω_t². The condition: λ (Ω_t² − 4) ≤ 4 Ω_0².",
        prove: |effort, _| tangents::changed_tangents(effort).into(),
    },
    Topic {
        name: "criterion",
        title: "Many degrees of freedom: the exact criterion beside mode-wise (41)",
        says: "The paper applies (41) mode by mode, the instantaneous mode j beside the initial mode j. That is exact only while the shapes stay. S(λ) = 4M + 2Δt(C0 − C_t) + (4Δt²/λ)K0 − Δt²K_t ⪰ 0 is necessary and sufficient for every structure; `gusset check` and `run` use it.",
        prove: |effort, _| criterion::criterion(effort).into(),
    },
    Topic {
        name: "recommendations",
        title: "Section 3.3: the recommended λ",
        says: "The most accurate λ that is stable for any step: 4 for linear and softening systems, 4 ω_0²/ω_t² for hardening ones (2.77 where ω_t = 1.2 ω_0).",
        prove: |effort, _| stability::recommendations(effort).into(),
    },
    Topic {
        name: "example-4.1",
        title: "Example 4.1, Fig. 7: a linear structure",
        says: "Two storeys under 20 sin t m/s², Δt = 0.05 s. λ = 4 goes with average acceleration, λ = ∞ with explicit Newmark; 17 and ∞ are unstable, 2, 4 and 11.5 are not; 11.5 comes close to the exact solution, while 2 and 4 visibly lengthen the period.",
        prove: |_, _| linear::example().into(),
    },
    Topic {
        name: "example-4.2",
        title: "Example 4.2, Figs. 8 to 13: softening and hardening",
        says: "Softening: 2, 4 and 4.7 are stable, 4.8 fluctuates at a high frequency, 4.9 and 11.5 are unstable; the upper limit is 4.75 at its lowest. Hardening: 1.2 and 3.7 are stable, 3.9, 4 and 11.5 are not; the upper limit is 3.79 at its lowest.",
        prove: |effort, _| nonlinear::example(effort).into(),
    },
    Topic {
        name: "example-4.3",
        title: "Example 4.3, Table 2, Figs. 15 and 16: the cost of a step",
        says: "No damping matrix is factorised within a step, diagonal or not, and the step stays explicit; the cost of the other methods relative to the family grows with the number of DOFs.",
        prove: cost::example,
    },
];

/// A name that no topic has.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("there is no topic {name:?}; topics are {}", TOPICS.map(|topic| topic.name).join(", "))]
pub struct UnknownTopic {
    /// As given.
    pub name: String,
}

/// The topics of these names, in the order of the paper; all of them if there is no name.
///
/// # Errors
/// The first name that no topic has.
pub fn select(names: &[String]) -> Result<Vec<Topic>, UnknownTopic> {
    if let Some(name) = names
        .iter()
        .find(|name| TOPICS.iter().all(|topic| topic.name != name.as_str()))
    {
        return Err(UnknownTopic { name: name.clone() });
    }
    let wanted = |topic: &Topic| names.is_empty() || names.iter().any(|name| name == topic.name);
    Ok(TOPICS.into_iter().filter(wanted).collect())
}
