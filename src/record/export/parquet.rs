//! Parquet, for tables larger than memory: `pandas.read_parquet`, Polars, DuckDB, Spark, Arrow.
//!
//! Every column is required, a double but for `sequence`; what does not exist is NaN. Plain encoding, not compressed, one
//! page per column and group of rows. Units, meanings and the summary stand in the file's own metadata as JSON. Written by
//! hand after the "Apache Parquet Format" 2: the crate for it adds 30 crates and 47 s of compiling for these 150 lines.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use serde_json::{Map, Value};

use super::block::{Block, Table};
use super::plan::{Choice, Plan, Source};
use super::thrift::Struct;
use super::{ExportError, Exported};
use crate::record::atomic::AtomicFile;
use crate::record::run::Run;

const MAGIC: &[u8; 4] = b"PAR1";
/// Bytes of a group of rows: it is held in memory.
const GROUP: usize = 64 << 20;
/// With more columns the groups would be flat and their descriptions longer than they are.
const WIDEST: usize = 2048;

/// Types.
const INT64: i32 = 2;
const DOUBLE: i32 = 5;
/// The encodings of values and of the levels, of which there are none.
const PLAIN: i32 = 0;
const RLE: i32 = 3;

/// Writes all columns.
pub(super) fn export(run: &Run, choice: &Choice, out: &Path) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let plan = Plan::new(run.layout())?;
    let columns = plan.columns();
    if columns.len() > WIDEST {
        return Err(ExportError::TooWide {
            format: "Parquet table",
            columns: columns.len(),
            limit: WIDEST,
        });
    }
    let mut journal = run.journal()?;
    let file = AtomicFile::create(out).map_err(failed)?;
    let mut table = Writer {
        out: BufWriter::new(file),
        at: 0,
        plan: &plan,
        groups: Vec::new(),
    };
    table.put(MAGIC).map_err(failed)?;
    let mut block = Block::new(columns, GROUP, u64::MAX);
    let rows = plan
        .walk(&mut journal, choice, u64::MAX, |sequence, row| {
            block.push(sequence, row);
            if block.is_full() {
                table.group(&mut block)?;
            }
            Ok(())
        })
        .map_err(|trouble| trouble.told(failed))?;
    table.group(&mut block).map_err(failed)?;
    let about = Table {
        run,
        plan: &plan,
        rows,
    };
    let file = table.finish(&about).map_err(failed)?;
    file.commit().map_err(failed)?;
    Ok(Exported::new(run, rows, &journal))
}

struct Writer<'a> {
    out: BufWriter<AtomicFile>,
    at: u64,
    plan: &'a Plan,
    groups: Vec<Struct>,
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    /// Writes the rows of a block as one group, and empties it.
    fn group(&mut self, block: &mut Block) -> io::Result<()> {
        let rows = block.rows() as u64;
        if rows == 0 {
            return Ok(());
        }
        let begin = self.at;
        let mut chunks = Vec::new();
        let plan = self.plan;
        for (exposed, bytes) in plan.columns().iter().zip(block.shares()) {
            let at = self.at;
            // A group is far shorter than 2 GiB.
            let (count, size) = (rows as i32, bytes.len() as i32);
            let values = Struct::default().i32(1, count).i32(2, PLAIN);
            let page = Struct::default().i32(1, 0).i32(2, size).i32(3, size);
            let page = page.inner(5, values.i32(3, RLE).i32(4, RLE));
            self.put(&page.finish())?;
            self.put(bytes)?;
            let length = self.at - at;
            let about = Struct::default()
                .i32(1, kind(exposed.source))
                .i32s(2, &[PLAIN, RLE])
                .texts(3, &[&exposed.column.name])
                .i32(4, 0)
                .i64(5, rows)
                .i64(6, length)
                .i64(7, length)
                .i64(9, at);
            chunks.push(Struct::default().i64(2, at).inner(3, about));
        }
        let group = Struct::default().structs(1, chunks);
        self.groups.push(group.i64(2, self.at - begin).i64(3, rows));
        block.clear();
        Ok(())
    }

    fn finish(mut self, table: &Table<'_>) -> io::Result<AtomicFile> {
        let columns = table.columns();
        let root = Struct::default()
            .text(4, "schema")
            .i32(5, columns.len() as i32);
        let leaves = columns.iter().map(|exposed| {
            let leaf = Struct::default().i32(1, kind(exposed.source)).i32(3, 0);
            leaf.text(4, &exposed.column.name)
        });
        let each = |value: fn(&crate::record::Column) -> &String| {
            let column = |c: &super::plan::Exposed| {
                (
                    c.column.name.clone(),
                    Value::from(value(&c.column).as_str()),
                )
            };
            Value::Object(columns.iter().map(column).collect::<Map<_, _>>()).to_string()
        };
        let notes = [
            ("units", each(|column| &column.unit)),
            ("meanings", each(|column| &column.meaning)),
            ("summary", table.text("summary.json")),
        ];
        let notes = notes.map(|(key, value)| Struct::default().text(1, key).text(2, &value));
        let footer = Struct::default()
            .i32(1, 2)
            .structs(2, std::iter::once(root).chain(leaves))
            .i64(3, table.rows)
            .structs(4, std::mem::take(&mut self.groups))
            .structs(5, notes)
            .text(6, concat!("Gusset version ", env!("CARGO_PKG_VERSION")))
            .finish();
        self.put(&footer)?;
        // Two thousand columns in groups of 64 MiB: the footer of a terabyte stays below 4 GiB.
        self.put(&(footer.len() as u32).to_le_bytes())?;
        self.put(MAGIC)?;
        self.out
            .into_inner()
            .map_err(io::IntoInnerError::into_error)
    }
}

const fn kind(source: Source) -> i32 {
    match source {
        Source::Sequence => INT64,
        Source::Place(_) | Source::Nothing => DOUBLE,
    }
}
