//! The published values of the family, obtained anew by the program's own code and judged: Gui, Wang, Jin, Chen and
//! Zhou (2014), table by table, equation by equation, figure by figure.
//!
//! A [`Topic`] is a piece of the paper under a name. Proving it gives a [`Part`]: checks, each with what the paper says,
//! what was obtained, the tolerance and the verdict, and the figures in the paper's axes. Where the paper is loose or
//! inconsistent the check says so as a [`Verdict::Note`] and judges what is true instead. Random systems come from
//! fixed seeds: two runs give the same text, timing apart.
//!
//! Nothing is written here: [`files`] gives the page, the pictures and their data as text.

mod accuracy;
mod cost;
mod drive;
mod figure;
mod formulas;
mod linear;
mod nonlinear;
mod page;
mod stability;
mod tangents;
#[cfg(test)]
mod tests;

use serde::Serialize;
use thiserror::Error;

pub use figure::{Figure, Scale, Series};
pub use page::files;

use crate::time::Clock;

/// What came of one check.
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
    /// What is looked at.
    pub what: String,
    /// What the paper says.
    pub paper: String,
    /// What was obtained.
    pub obtained: String,
    /// How far they may be apart, or how it is judged.
    pub tolerance: String,
    /// What came of it.
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
    pub fn within(what: &str, paper: &str, obtained: f64, bound: f64) -> Self {
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
    pub fn holds(what: &str, paper: &str, obtained: String, how: &str, holds: bool) -> Self {
        Self {
            what: what.to_owned(),
            paper: paper.to_owned(),
            obtained,
            tolerance: how.to_owned(),
            verdict: judged(holds),
        }
    }

    /// Something to be said and not judged.
    #[must_use]
    pub fn note(what: &str, paper: &str, obtained: String, remark: &str) -> Self {
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
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let before = libm::floor(libm::log10(size)) as i32;
    let decimals = usize::try_from(5 - before).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// What came of one piece of the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Part {
    /// Name of its topic.
    pub name: &'static str,
    /// What it is.
    pub title: &'static str,
    /// Its values and statements.
    pub checks: Vec<Check>,
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
    /// `quick` or `whole`, as it is.
    fn of(self, quick: usize, whole: usize) -> usize {
        match self {
            Self::Quick => quick,
            Self::Whole => whole,
        }
    }
}

/// Checks and figures of a topic.
type Proof = (Vec<Check>, Vec<Figure>);

/// A piece of the paper.
#[derive(Debug, Clone, Copy)]
pub struct Topic {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is.
    pub title: &'static str,
    prove: fn(Effort, &dyn Clock) -> Proof,
}

impl Topic {
    /// Does the work. `clock` times example 4.3 and nothing else.
    #[must_use]
    pub fn prove(&self, effort: Effort, clock: &dyn Clock) -> Part {
        let (checks, figures) = (self.prove)(effort, clock);
        Part {
            name: self.name,
            title: self.title,
            checks,
            figures,
        }
    }
}

/// All topics, in the order of the paper.
pub const TOPICS: [Topic; 14] = [
    Topic {
        name: "table-1",
        title: "Table 1 and equation (13): poles, and one α for all",
        prove: |effort, _| formulas::table_1(effort),
    },
    Topic {
        name: "transfer",
        title: "Equations (11) to (19): transfer function and amplification matrix",
        prove: |effort, _| formulas::transfer(effort),
    },
    Topic {
        name: "fig-1",
        title: "Fig. 1: amplitude decay",
        prove: |_, _| accuracy::amplitude_decay(),
    },
    Topic {
        name: "fig-2",
        title: "Fig. 2: period elongation",
        prove: |_, _| accuracy::period_elongation(),
    },
    Topic {
        name: "fig-3",
        title: "Fig. 3: stable and unstable poles",
        prove: |effort, _| stability::regions(effort),
    },
    Topic {
        name: "eq-33",
        title: "Equations (27) to (33): the linear limit",
        prove: |effort, _| stability::linear_limit(effort),
    },
    Topic {
        name: "fig-4",
        title: "Fig. 4, equations (36) to (39): the closed loop",
        prove: |effort, _| tangents::closed_loop(effort),
    },
    Topic {
        name: "fig-5",
        title: "Fig. 5: root locus of a changed stiffness",
        prove: |_, _| tangents::root_locus(),
    },
    Topic {
        name: "eq-41",
        title: "Equations (40) and (41): changed tangents",
        prove: |effort, _| tangents::changed_tangents(effort),
    },
    Topic {
        name: "criterion",
        title: "Many degrees of freedom: the exact criterion beside mode-wise (41)",
        prove: |effort, _| tangents::criterion(effort),
    },
    Topic {
        name: "recommendations",
        title: "Section 3.3: the recommended λ",
        prove: |effort, _| stability::recommendations(effort),
    },
    Topic {
        name: "example-4.1",
        title: "Example 4.1, Fig. 7: a linear structure",
        prove: |_, _| linear::example(),
    },
    Topic {
        name: "example-4.2",
        title: "Example 4.2, Figs. 8 to 13: softening and hardening",
        prove: |_, _| nonlinear::example(),
    },
    Topic {
        name: "example-4.3",
        title: "Example 4.3, Table 2, Fig. 16: the cost of a step",
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
