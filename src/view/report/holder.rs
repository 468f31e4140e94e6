//! Columns that are held whole while the rows are read.

use std::io;

use super::columns::SpecimenAxis;
use super::row_filter::{Gap, RowFilter, Stretch};
use super::source::Source;
use super::stale::{Stale, status_of};
use super::table::Table;
use gusset_record::{COMMITS, Column};

/// Results of columns that are held whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Item {
    Ground,
    Dof(u32),
    Axis(SpecimenAxis),
}

impl Item {
    /// True if it is made of every tick, and not of the ends of steps.
    pub(crate) const fn is_of_ticks(self) -> bool {
        matches!(self, Item::Axis(_))
    }

    /// The specimen that it is of.
    const fn specimen(self) -> Option<u32> {
        match self {
            Item::Axis(axis) => Some(axis.specimen),
            Item::Ground | Item::Dof(_) => None,
        }
    }

    /// Names of the columns that it is made of.
    pub(crate) fn columns(self) -> Vec<String> {
        match self {
            Item::Ground => vec!["ground".to_owned()],
            Item::Dof(dof) => vec![format!("x{dof}")],
            Item::Axis(axis) => ["target", "meas", "force"]
                .map(|kind| axis.column(kind))
                .into(),
        }
    }
}

/// Columns that are held whole: at the ends of steps, and at every tick. A NaN entry replaces missing rows.
#[derive(Debug, Clone)]
pub(super) struct Holder {
    /// Their places in a block, and they themselves.
    parts: [(Vec<usize>, Vec<Vec<f64>>); 2],
    time: Option<usize>,
}

impl Holder {
    /// For the columns of `batch`, with time and state; `columns` are those of a block.
    pub(crate) fn new(columns: &[Column], batch: &[Item]) -> Self {
        let at = |name: &str| columns.iter().position(|c| c.name == name);
        let places = |of_ticks: bool| {
            let of = batch.iter().filter(|item| item.is_of_ticks() == of_ticks);
            let names = ["time", "state"].map(str::to_owned);
            let names = names.into_iter().chain(of.flat_map(|item| item.columns()));
            let mut places: Vec<usize> = names.filter_map(|name| at(&name)).collect();
            places.sort_unstable();
            places.dedup();
            let held = vec![Vec::new(); places.len()];
            (places, held)
        };
        Self {
            parts: [places(false), places(true)],
            time: at("time"),
        }
    }

    /// Takes a stretch of rows: `kind` 0 for ends of steps, 1 for ticks.
    pub(crate) fn take(&mut self, kind: usize, stretch: &Stretch, block: &[Vec<f64>]) {
        let (places, held) = &mut self.parts[kind];
        for (&place, to) in places.iter().zip(held) {
            if let Some(Gap { time, .. }) = stretch.gap {
                to.push(if self.time == Some(place) {
                    time
                } else {
                    f64::NAN
                });
            }
            to.extend(stretch.rows.iter().map(|&row| block[place][row]));
        }
    }

    /// The columns by name.
    pub(crate) fn finish(self, columns: &[Column]) -> [Table; 2] {
        self.parts.map(|(places, held)| {
            let names = places.iter().map(|&place| columns[place].clone());
            Table::new(names.zip(held).collect())
        })
    }
}

/// The columns of `batch`, whole.
pub(super) fn hold(source: &dyn Source, batch: &[Item]) -> io::Result<[Table; 2]> {
    let mut names: Vec<String> = ["state", "step", "time", COMMITS].map(str::to_owned).into();
    names.extend(batch.iter().flat_map(|item| item.columns()));
    let mut specimens: Vec<u32> = batch.iter().filter_map(|item| item.specimen()).collect();
    specimens.dedup();
    names.extend(specimens.into_iter().map(status_of));
    let place = |name: &String| source.columns().iter().position(|c| c.name == *name);
    let wanted: Vec<usize> = names.iter().filter_map(place).collect();
    let columns: Vec<Column> = wanted
        .iter()
        .map(|&place| source.columns()[place].clone())
        .collect();
    let mut row_filter = row_filter(source, &columns);
    let mut holder = Holder::new(&columns, batch);
    let stale = Stale::new(&columns);
    source.read(&wanted, &mut |block| {
        let block = &*stale.left_out(block);
        for (kind, stretches) in row_filter.sort(block).iter().enumerate() {
            for stretch in stretches {
                holder.take(kind, stretch, block);
            }
        }
    })?;
    Ok(holder.finish(&columns))
}

/// The sorter of the rows of `source`, whose blocks have these columns.
pub(super) fn row_filter(source: &dyn Source, columns: &[Column]) -> RowFilter {
    let at = |name: &str| columns.iter().position(|c| c.name == name);
    let is_served = source.columns().iter().any(|c| c.name == COMMITS);
    // A server numbers exchanges; the steps are those of its controller.
    let step = if is_served { COMMITS } else { "step" };
    let places = ["state", step, "time"].map(at);
    RowFilter::new(places, source.step_s(), source.ticks_per_step()).of_a_server(is_served)
}
