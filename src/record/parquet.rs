//! A table as Apache Parquet, which pandas, Polars, DuckDB, R and MATLAB read.
//!
//! Columns are typed, a missing value is null, and the pages are compressed (GZIP, by `flate2`, which HDR histograms need anyway).
//! The key `gusset.columns` of the file's metadata has the name, unit, type and meaning of each column as JSON. Rows are written in
//! groups, and only one group is in memory.

use std::io::{self, BufWriter};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, GzipLevel, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{ColumnPath, Type};

use crate::atomic::AtomicFile;
use crate::cell::{Cell, CellKind, TableColumn};

/// Most values in memory.
const MOST_VALUES: usize = 1 << 20;
/// Most rows of a group.
const MOST_ROWS: usize = 1 << 16;

/// The values of one column of a row group.
#[derive(Debug)]
enum Values {
    Integers(Vec<i64>),
    Numbers(Vec<f64>),
    Texts(Vec<ByteArray>),
}

/// One column of a row group: its values, and a level for each row: 0 for a missing value, 1 for another.
#[derive(Debug)]
struct Column {
    values: Values,
    levels: Vec<i16>,
}

/// A Parquet file that is being written.
#[derive(Debug)]
pub struct ParquetTable {
    writer: SerializedFileWriter<BufWriter<AtomicFile>>,
    columns: Vec<Column>,
    rows: usize,
    rows_per_group: usize,
}

impl ParquetTable {
    /// Begins the file that will appear at `path`. Its metadata gets these pairs too, `gusset.` before each key.
    ///
    /// # Errors
    /// The system refuses.
    pub fn create(
        path: &Path,
        columns: &[TableColumn],
        metadata: Vec<(&'static str, String)>,
    ) -> io::Result<Self> {
        let file = AtomicFile::create(path)?;
        let writer = begun(file, columns, metadata).map_err(system)?;
        let empty = columns.iter().map(|column| Column {
            values: match column.kind {
                CellKind::Integer => Values::Integers(Vec::new()),
                CellKind::Number => Values::Numbers(Vec::new()),
                CellKind::Text => Values::Texts(Vec::new()),
            },
            levels: Vec::new(),
        });
        Ok(Self {
            writer,
            columns: empty.collect(),
            rows: 0,
            rows_per_group: (MOST_VALUES / columns.len().max(1)).clamp(1, MOST_ROWS),
        })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// The system refuses.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) -> io::Result<()> {
        for (column, cell) in self.columns.iter_mut().zip(cells) {
            column.take(cell);
        }
        self.rows += 1;
        if self.rows == self.rows_per_group {
            self.flush()?;
        }
        Ok(())
    }

    /// Writes the rows in memory as a group.
    fn flush(&mut self) -> io::Result<()> {
        if self.rows > 0 {
            self.rows = 0;
            group(&mut self.writer, &mut self.columns).map_err(system)?;
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The system refuses.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        let buffer = self.writer.into_inner().map_err(system)?;
        let file = buffer.into_inner().map_err(io::IntoInnerError::into_error);
        file.and_then(AtomicFile::commit)
    }
}

impl Column {
    fn take(&mut self, cell: Cell) {
        let is_there = match (&mut self.values, cell) {
            (Values::Integers(all), Cell::Integer(value)) => {
                all.push(value);
                true
            }
            (Values::Numbers(all), Cell::Number(value)) => {
                all.push(value);
                true
            }
            (Values::Texts(all), Cell::Text(text)) => {
                all.push(ByteArray::from(text.into_bytes()));
                true
            }
            _ => false,
        };
        self.levels.push(i16::from(is_there));
    }
}

/// Writes the columns as a row group, and empties them.
fn group(
    writer: &mut SerializedFileWriter<BufWriter<AtomicFile>>,
    columns: &mut [Column],
) -> ParquetResult<()> {
    let mut group = writer.next_row_group()?;
    for Column { values, levels } in columns {
        let Some(out) = group.next_column()? else {
            break;
        };
        match values {
            Values::Integers(all) => batch::<Int64Type>(out, all, levels)?,
            Values::Numbers(all) => batch::<DoubleType>(out, all, levels)?,
            Values::Texts(all) => batch::<ByteArrayType>(out, all, levels)?,
        }
    }
    group.close()?;
    Ok(())
}

fn batch<T: DataType>(
    mut out: SerializedColumnWriter<'_>,
    values: &mut Vec<T::T>,
    levels: &mut Vec<i16>,
) -> ParquetResult<()> {
    out.typed::<T>().write_batch(values, Some(levels), None)?;
    values.clear();
    levels.clear();
    out.close()
}

/// A writer with the schema and the metadata of `columns`. Equal columns give equal bytes.
fn begun(
    file: AtomicFile,
    columns: &[TableColumn],
    metadata: Vec<(&'static str, String)>,
) -> ParquetResult<SerializedFileWriter<BufWriter<AtomicFile>>> {
    let mut fields = Vec::new();
    let of_columns = (
        "columns",
        serde_json::to_string(columns).unwrap_or_default(),
    );
    let pairs = metadata.into_iter().chain([of_columns]);
    let pairs = pairs.map(|(key, value)| KeyValue::new(format!("gusset.{key}"), value));
    let mut properties = WriterProperties::builder()
        .set_created_by(format!("gusset {}", env!("CARGO_PKG_VERSION")))
        .set_statistics_enabled(EnabledStatistics::Chunk)
        // Indices of pages would stay in memory until the end.
        .set_offset_index_disabled(true)
        .set_dictionary_enabled(false)
        .set_compression(Compression::GZIP(GzipLevel::default()))
        .set_key_value_metadata(Some(pairs.collect()));
    for column in columns {
        let (physical, logical) = match column.kind {
            CellKind::Integer => (Physical::INT64, None),
            CellKind::Number => (Physical::DOUBLE, None),
            CellKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        if column.kind == CellKind::Text {
            let path = ColumnPath::new(vec![column.name.clone()]);
            properties = properties.set_column_dictionary_enabled(path, true);
        }
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical);
        fields.push(Arc::new(field.build()?));
    }
    let schema = Type::group_type_builder("table").with_fields(fields);
    let (schema, properties) = (Arc::new(schema.build()?), Arc::new(properties.build()));
    SerializedFileWriter::new(BufWriter::new(file), schema, properties)
}

/// Error of the operating system, or else of the library.
fn system(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => io::Error::other(source),
        other => io::Error::other(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    use super::*;

    fn column(name: &str, kind: CellKind) -> TableColumn {
        TableColumn {
            name: name.to_owned(),
            unit: "1".to_owned(),
            kind,
            meaning: String::new(),
        }
    }

    #[test]
    fn rows_return_from_groups_with_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.parquet");
        let columns = [
            column("a.b", CellKind::Integer),
            column("number", CellKind::Number),
            column("text", CellKind::Text),
        ];
        let mut table = ParquetTable::create(&path, &columns, Vec::new()).unwrap();
        table.rows_per_group = 10;
        let numbers = [0.1, -0.0, f64::INFINITY, f64::MIN_POSITIVE / 4.0, 1e300];
        for row in 0..25_i64 {
            let number = numbers[row as usize % numbers.len()];
            let text = match row % 3 {
                0 => Cell::Missing,
                _ => Cell::Text(format!("{row}, ü")),
            };
            let cells = vec![Cell::Integer(row - 12), Cell::Number(number), text];
            table.row(cells).unwrap();
        }
        assert!(!path.exists());
        table.finish().unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!(reader.num_row_groups(), 3);
        let mut count = 0;
        for (at, row) in reader.get_row_iter(None).unwrap().enumerate() {
            let row = row.unwrap();
            let number = numbers[at % numbers.len()];
            assert_eq!(row.get_long(0).unwrap(), at as i64 - 12);
            assert_eq!(row.get_double(1).unwrap().to_bits(), number.to_bits());
            // A null is no text.
            let text = row.get_string(2).ok().cloned();
            assert_eq!(text, (at % 3 > 0).then(|| format!("{at}, ü")));
            count += 1;
        }
        assert_eq!(count, 25);
    }
}
