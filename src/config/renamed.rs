//! Renamed keys: each is read under its old name too, and a warning gives the new one.
//!
//! The entries are moved in the tree of the file before it is read, so that all later code knows the new names alone. A
//! moved entry keeps its place in the text: a diagnostic points at the user's text. `--set` and the keys of
//! `[[uncertainty]]` accept the old names as well. An old name beside the new one is not moved, and the file is
//! refused. A law that is a special case of another is a renamed key that adds parameters.

use super::document::{Datum, KeyPath, Node, Segment};
use gusset_quantity::finding::Finding;

/// A key with a new name.
struct RenamedKey {
    /// The tables that contain it, as [`KeyPath::shape`] writes them. `*` at the beginning means any table above.
    tables: &'static [&'static str],
    /// Old and new name: dotted paths within the table.
    from: &'static str,
    to: &'static str,
    /// Old and new name of a parameter.
    inside: &'static [(&'static str, &'static str)],
    /// A parameter that the old name implies.
    implied: Option<(&'static str, f64)>,
    /// The key of the table without which the old name has no meaning.
    beside: Option<&'static str>,
}

const fn renamed(
    table: &'static [&'static str],
    from: &'static str,
    to: &'static str,
) -> RenamedKey {
    RenamedKey {
        tables: table,
        from,
        to,
        inside: &[],
        implied: None,
        beside: None,
    }
}

const fn stand_in(from: &'static str, to: &'static str) -> RenamedKey {
    RenamedKey {
        beside: Some("link"),
        ..renamed(&["specimen[*]"], from, to)
    }
}

const TIMING: &[&str] = &["timing"];
/// Tables and lists that hold a law.
const LAWS: &[&str] = &["*.law", "*.laws[*]", "*.parallel[*]", "*.absolute_damper"];
const PERFECTLY_PLASTIC: Option<(&str, f64)> = Some(("post_yield_ratio", 0.0));

/// A key of an outer table comes before those inside it.
const RENAMED: &[RenamedKey] = &[
    renamed(TIMING, "max_consecutive_misses", "misses.in_a_row.trip"),
    renamed(TIMING, "warn_consecutive_misses", "misses.in_a_row.warn"),
    renamed(TIMING, "max_total_misses", "misses.in_total.trip"),
    renamed(TIMING, "warn_total_misses", "misses.in_total.warn"),
    renamed(TIMING, "max_misses_in_window", "misses.in_window.trip"),
    renamed(TIMING, "warn_misses_in_window", "misses.in_window.warn"),
    renamed(TIMING, "miss_window_s", "misses.window_s"),
    stand_in("stand_in.law", "law"),
    stand_in("stand_in.laws", "laws"),
    stand_in("stand_in.coupled", "coupled"),
    stand_in("stand_in_transfer", "transfer"),
    RenamedKey {
        implied: PERFECTLY_PLASTIC,
        ..renamed(LAWS, "elastic_plastic", "bilinear")
    },
    RenamedKey {
        inside: &[("slip_force_n", "yield_force_n")],
        implied: PERFECTLY_PLASTIC,
        ..renamed(LAWS, "coulomb", "bilinear")
    },
    RenamedKey {
        implied: Some(("stiffness_n_per_m", 0.0)),
        ..renamed(LAWS, "viscous", "linear")
    },
];

fn keys(dotted: &str) -> Vec<&str> {
    dotted.split('.').collect()
}

impl RenamedKey {
    fn is_of(&self, table: &KeyPath) -> bool {
        let shape = table.shape();
        self.tables.iter().any(|of| match of.strip_prefix('*') {
            Some(end) => shape.ends_with(end),
            None => shape == *of,
        })
    }

    /// Moves the entry within the table `node`. True if it did.
    fn move_in(&self, node: &mut Node) -> bool {
        let (from, to) = (keys(self.from), keys(self.to));
        let has = |key: &str| node.find(&KeyPath::root().key(key)).is_some();
        if self.beside.is_some_and(|key| !has(key)) || node.is_taken(&to) {
            return false;
        }
        let Some(mut entry) = node.take(&from) else {
            return false;
        };
        for (old, new) in self.inside {
            if let Some(parameter) = entry.take(&[old]) {
                entry.put(&[new], parameter);
            }
        }
        if let Some((key, value)) = self.implied
            && !entry.is_taken(&[key])
        {
            let implied = Node {
                datum: Datum::Float(value),
                ..entry.clone()
            };
            entry.put(&[key], implied);
        }
        node.put(&to, entry);
        true
    }

    fn note(&self, table: &KeyPath) -> Finding {
        let (old, new) = (table.under(self.from), table.under(self.to));
        let headline = format!("`{old}` is now called `{new}`");
        let finding = Finding::warning(new, headline).at_key();
        let finding = finding.label("the old name; it is still accepted");
        match self.implied {
            Some((key, value)) => finding.help(format!("add `{key} = {value:?}`")),
            None => finding,
        }
    }
}

/// An entry that was moved.
pub(super) struct Move {
    key: &'static RenamedKey,
    table: KeyPath,
}

/// Moves each entry with an old name in the tree of a file.
pub(super) fn rename(root: &mut Node) -> Vec<Move> {
    let mut moves = Vec::new();
    root.each_table(&KeyPath::root(), &mut |table, node| {
        for key in RENAMED.iter().filter(|key| key.is_of(table)) {
            if key.move_in(node) {
                let table = table.clone();
                moves.push(Move { key, table });
            }
        }
    });
    moves
}

/// Today's path of each moved entry, and the path that the user wrote.
pub(super) fn written(moves: &[Move]) -> Vec<(String, String)> {
    let paths = moves.iter().map(|Move { key, table }| {
        let [now, then] = [key.to, key.from].map(|name| table.under(name).to_string());
        (now, then)
    });
    paths.collect()
}

/// One warning for each old name that the file uses.
pub(super) fn notes(moves: &[Move]) -> Vec<Finding> {
    let mut noted: Vec<&Move> = Vec::new();
    for one in moves {
        if !noted.iter().any(|other| std::ptr::eq(other.key, one.key)) {
            noted.push(one);
        }
    }
    noted.iter().map(|one| one.key.note(&one.table)).collect()
}

/// The present path of an entry, with the move of its old name. `holds` returns whether the file has a key: some old names have
/// a meaning only beside another key.
pub(super) fn current(path: &KeyPath, holds: &dyn Fn(&KeyPath) -> bool) -> Option<(KeyPath, Move)> {
    let segments = path.segments();
    for length in 0..segments.len() {
        let table: KeyPath = segments[..length].iter().cloned().collect();
        for key in RENAMED.iter().filter(|key| key.is_of(&table)) {
            let old = table.under(key.from);
            let has = |beside: &str| holds(&table.key(beside));
            if !path.starts_with(&old) || key.beside.is_some_and(|beside| !has(beside)) {
                continue;
            }
            let mut now = table.under(key.to);
            for segment in &segments[old.segments().len()..] {
                let renamed = key
                    .inside
                    .iter()
                    .find(|(old, _)| matches!(segment, Segment::Key(name) if name == old));
                now = match (renamed, segment) {
                    (Some((_, new)), _) => now.key(new),
                    (None, Segment::Key(name)) => now.key(name),
                    (None, Segment::Index(index)) => now.index(*index),
                };
            }
            // A law inside a stand-in may have an old name, too.
            let now = current(&now, holds).map_or(now, |(now, _)| now);
            return Some((now, Move { key, table }));
        }
    }
    None
}

/// The finding for an unknown key with an old name: its new name is given too.
pub(super) fn finding(path: &KeyPath) -> Option<Finding> {
    let table = path.parent()?;
    let is_it = |key: &&RenamedKey| key.is_of(&table) && path.last_key() == Some(key.from);
    let key = RENAMED.iter().find(is_it)?;
    let new = table.under(key.to);
    let finding = Finding::error(path.clone(), format!("`{path}` is the old name of `{new}`"));
    Some(
        finding
            .at_key()
            .label("the old name")
            .beside(new, "the new name is given too")
            .help("remove the old key"),
    )
}
