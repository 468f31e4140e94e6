//! The rows of a table in text: the separator of their fields, their numbers, and a first row with count and step.

use super::header::{Header, HeaderLine};
use super::text::{fields, finite_number, number, refuse_decimal_comma, shorten};
use super::{MOST_COLUMNS, MOST_VALUES, Print, RawTable, RecordFormat};
use crate::error::MotionError;

/// Least count of values that a line before them may state: fewer may as well be a row of the table.
const LEAST_COUNT: usize = 3;

/// The caller's knowledge of a table.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Settings {
    /// Lines that are skipped before anything is read.
    pub(super) skip_rows: usize,
    /// How many columns there must be.
    pub(super) columns: Option<usize>,
    /// The numbers are one column in reading order, with any count per line.
    pub(super) reading_order: bool,
    /// Fields are parted by commas, semicolons or tabs, not by blanks.
    pub(super) separated: bool,
    /// The words of a header name their columns, even where none is called a time.
    pub(super) named: bool,
    /// A first line may state the count of values and the step.
    pub(super) counted: bool,
}

/// The sign between two fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Delimiter {
    Semicolon,
    Comma,
    Tab,
    Blank,
}

impl Delimiter {
    /// The sign between the names of a header: there a tab is a blank.
    pub(super) const fn sign(self) -> char {
        match self {
            Self::Semicolon => ';',
            Self::Comma => ',',
            Self::Tab | Self::Blank => ' ',
        }
    }

    /// The fields of a line, each with the byte at which it begins.
    pub(super) fn cells(self, line: &str) -> Vec<(usize, &str)> {
        if self == Self::Blank {
            let words = line.split_whitespace();
            let bare = words.map(|word| word.trim_end_matches([',', ';']).trim_matches('"'));
            // Both are slices of the same string.
            let start = |word: &str| word.as_ptr() as usize - line.as_ptr() as usize;
            let filled = bare.filter(|word| !word.is_empty());
            return filled.map(|word| (start(word), word)).collect();
        }
        let sign = if self == Self::Tab { '\t' } else { self.sign() };
        let line = line.trim_end();
        fields(line.strip_suffix(sign).unwrap_or(line), sign)
    }

    /// True if a comma within a field can only be a decimal comma; `width` is the number of fields in the row.
    fn takes_commas(self, width: usize) -> bool {
        match self {
            Self::Semicolon => true,
            Self::Comma => false,
            // A single `0,5` may as well be two columns.
            Self::Tab | Self::Blank => width > 1,
        }
    }

    /// What parts the numbers of `line`; none unless all its fields are numbers.
    pub(super) fn of(line: &str, stated: Option<char>, settings: &Settings) -> Option<Self> {
        let has_tab = line.trim().contains('\t');
        Self::allowed(stated).find(|delimiter| {
            let cells = delimiter.cells(line);
            let width = cells.len();
            let is_parted = match delimiter {
                // As a blank, two tabs around an empty field would move the fields after it.
                Self::Tab => has_tab,
                Self::Blank => !has_tab && (!settings.separated || width == 1),
                // A last sign shows the separator, too.
                _ => width > 1 || stated.is_some() || line.trim_end().ends_with(delimiter.sign()),
            };
            let takes_commas = delimiter.takes_commas(width);
            let is_number = |(_, cell): &(usize, &str)| {
                number(cell).is_some() || (takes_commas && number(&pointed(cell)).is_some())
            };
            is_parted && width > 0 && cells.iter().all(is_number)
        })
    }

    /// What most likely parts the fields of a `line` that is not all numbers.
    pub(super) fn likely(line: &str, stated: Option<char>, settings: &Settings) -> Self {
        let is_there = |delimiter: &Self| match delimiter {
            Self::Semicolon => line.contains(';'),
            Self::Comma => settings.separated || line.contains(','),
            Self::Tab => line.trim().contains('\t'),
            Self::Blank => true,
        };
        let found = Self::allowed(stated).find(is_there);
        found.unwrap_or(Self::Blank)
    }

    /// All separators, or those that a first line states.
    fn allowed(stated: Option<char>) -> impl Iterator<Item = Self> {
        let all = [Self::Semicolon, Self::Comma, Self::Tab, Self::Blank];
        let is_stated = move |delimiter: &Self| stated.is_none_or(|sign| delimiter.sign() == sign);
        all.into_iter().filter(is_stated)
    }
}

/// A number with its decimal comma as a point.
pub(super) fn pointed(cell: &str) -> String {
    cell.replace(',', ".")
}

/// The rows read so far; they may have different widths.
pub(super) struct Rows<'t> {
    pub(super) file: &'t str,
    pub(super) delimiter: Delimiter,
    first: &'t str,
    /// Fields of the first row.
    pub(super) width: usize,
    /// Line and fields of the second row.
    second: Option<(usize, usize)>,
    /// Line and fields of the first row that differs from the first, and from the second.
    ragged: [Option<(usize, usize)>; 2],
    values: Vec<f64>,
    lines: Vec<usize>,
    prints: Vec<Print>,
    marks: Marks,
}

impl<'t> Rows<'t> {
    pub(super) fn new(file: &'t str, delimiter: Delimiter, first: &'t str) -> Self {
        Self {
            file,
            delimiter,
            first,
            width: delimiter.cells(first).len(),
            second: None,
            ragged: [None; 2],
            values: Vec::new(),
            lines: Vec::new(),
            prints: Vec::new(),
            marks: Marks::default(),
        }
    }

    pub(super) fn read(&mut self, line_number: usize, line: &str) -> Result<(), MotionError> {
        let cells = self.delimiter.cells(line);
        let too_large = |what, found, limit| MotionError::TooLarge {
            file: self.file.into(),
            what,
            found,
            limit,
        };
        if cells.len() > MOST_COLUMNS {
            return Err(too_large("columns", cells.len(), MOST_COLUMNS));
        }
        let total = self.values.len() + cells.len();
        if total > MOST_VALUES {
            return Err(too_large("values", total, MOST_VALUES));
        }
        let found = (line_number, cells.len());
        for (column, (start, cell)) in cells.into_iter().enumerate() {
            let value = self.number(line_number, line, start, cell)?;
            let print = Print::of(cell);
            match self.prints.get_mut(column) {
                Some(known) => known.widen(print),
                None => self.prints.push(print),
            }
            self.values.push(value);
        }
        self.lines.push(line_number);
        if self.lines.len() == 2 {
            self.second = Some(found);
        }
        let widths = [Some(self.width), self.second.map(|(_, width)| width)];
        for (ragged, width) in self.ragged.iter_mut().zip(widths) {
            if width.is_some_and(|width| width != found.1) {
                ragged.get_or_insert(found);
            }
        }
        Ok(())
    }

    fn number(
        &mut self,
        line_number: usize,
        line: &str,
        start: usize,
        cell: &str,
    ) -> Result<f64, MotionError> {
        if !cell.contains(',') {
            let value = finite_number(self.file, line_number, line, start, cell)?;
            self.marks.has_point |= cell.contains('.');
            return match &self.marks.comma {
                Some(comma) if self.marks.has_point => Err(comma.refused(self.file)),
                _ => Ok(value),
            };
        }
        let comma = Comma::of(line_number, line, start, cell);
        if self.marks.has_point || !self.delimiter.takes_commas(self.width) {
            let end = start + cell.len();
            refuse_decimal_comma(self.file, line_number, line, start..end)?;
            return Err(comma.refused(self.file));
        }
        let value = finite_number(self.file, line_number, line, start, &pointed(cell))?;
        self.marks.is_proven |= comma.is_decimal();
        self.marks.comma.get_or_insert(comma);
        Ok(value)
    }

    /// The count and the step in the first row, if that is what it states: `400 0.01`, then 400 values.
    fn count(&self) -> Result<Option<Count>, MotionError> {
        let ([points, dt, rest @ ..], Some((_, width)), 2) =
            (self.values.as_slice(), self.second, self.width)
        else {
            return Ok(None);
        };
        let first = self.delimiter.cells(self.first);
        let is_whole = |cell: &str| cell.bytes().all(|byte| byte.is_ascii_digit());
        if !(first.first().is_some_and(|(_, cell)| is_whole(cell)) && *dt > 0.0) {
            return Ok(None);
        }
        let [ragged, rest_ragged] = self.ragged.map(|row| row.is_some());
        let rises = |rows: &[f64], width: usize| {
            let times = || rows.iter().step_by(width);
            times().zip(times().skip(1)).all(|(now, next)| now < next)
        };
        let (announced, rows) = (*points as usize, self.lines.len() - 1);
        let is_table = !ragged && rises(&self.values, 2);
        if is_table || announced < LEAST_COUNT {
            return Ok(None);
        }
        let of = |in_reading_order| Count {
            dt: *dt,
            in_reading_order,
        };
        if announced == rest.len() {
            return Ok(Some(of(true)));
        }
        if announced == rows && width > 1 && !rest_ragged && rises(rest, width) {
            return Ok(Some(of(false)));
        }
        // Rows of another width cannot be a table with the first row.
        let is_list = width == 1 && !rest_ragged;
        if ragged && (is_list || (width != 2 && *dt < 1.0)) {
            return Err(MotionError::Count {
                file: self.file.into(),
                announced,
                found: rest.len(),
            });
        }
        Ok(None)
    }

    /// Makes the table. `lines` are the last lines of its header; `worded` lines of the header are no comments.
    pub(super) fn into_table(
        mut self,
        lines: &[HeaderLine<'_>],
        worded: usize,
        settings: &Settings,
    ) -> Result<RawTable, MotionError> {
        self.marks.judged(self.file, self.delimiter)?;
        let first_line = self.lines.first().copied().unwrap_or(1);
        let count = if settings.counted {
            self.count()?
        } else {
            None
        };
        let runs_on = settings.reading_order || count.is_some_and(|count| count.in_reading_order);
        let names = self.names(lines);
        self.refuse_first_row(first_line, names, count.is_some() || runs_on)?;
        let columns = self.shaped(first_line, count.is_some(), runs_on, settings)?;
        let header = Header::read(lines, columns, self.delimiter.sign(), settings.named);
        if let (true, false, Some(names)) = (header.labels.is_empty(), runs_on, names) {
            return Err(self.uneven((first_line, columns), names));
        }
        let mut warnings = Vec::new();
        let is_separated = self.delimiter != Delimiter::Blank;
        if worded > header.used || (worded > 0 && self.delimiter.sign() == ' ') {
            warnings.push(format!(
                "{}: the first {worded} line(s) are taken as a header",
                self.file
            ));
        }
        let format = match columns {
            _ if runs_on => RecordFormat::List,
            1 => RecordFormat::OneColumn,
            _ if is_separated => RecordFormat::Csv,
            2 => RecordFormat::TwoColumn,
            _ => RecordFormat::Table,
        };
        Ok(RawTable {
            format: Some(format),
            columns,
            values: self.values,
            lines: self.lines,
            prints: self.prints,
            header,
            stated_dt: count.map(|count| count.dt),
            first_row: shorten(self.first.trim()),
            warnings,
        })
    }

    /// Refuses a first row of another width than all rows after it, which have the same.
    fn refuse_first_row(
        &self,
        first_line: usize,
        names: Option<usize>,
        may_differ: bool,
    ) -> Result<(), MotionError> {
        let [_, rest_ragged] = self.ragged;
        match self.second {
            Some((_, width)) if width != self.width && rest_ragged.is_none() && !may_differ => {
                let is_proven = self.lines.len() > 2 || names == Some(width);
                match is_proven {
                    true => Err(self.uneven((first_line, self.width), width)),
                    false => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }

    /// Leaves out a row that states the count, and refuses rows of unequal width. Returns the number of columns.
    fn shaped(
        &mut self,
        first_line: usize,
        is_counted: bool,
        runs_on: bool,
        settings: &Settings,
    ) -> Result<usize, MotionError> {
        let (mut columns, mut ragged) = (self.width, self.ragged[0]);
        if is_counted {
            self.values.drain(..2);
            self.lines.remove(0);
            (columns, ragged) = (self.second.map_or(1, |(_, width)| width), self.ragged[1]);
        }
        let all = 0..self.first.len();
        if runs_on {
            if self.delimiter == Delimiter::Comma {
                refuse_decimal_comma(self.file, first_line, self.first, all)?;
            }
            self.lines.clear();
            return Ok(1);
        }
        if let Some(row) = ragged {
            return Err(self.uneven(row, columns));
        }
        if let Some(wanted) = settings.columns.filter(|wanted| *wanted != columns) {
            if wanted == 1 && !self.first.contains(", ") {
                refuse_decimal_comma(self.file, first_line, self.first, all)?;
            }
            return Err(self.uneven((first_line, columns), wanted));
        }
        Ok(columns)
    }

    /// The error of a row, by its line and its width, that should be `wanted` wide.
    fn uneven(&self, (line, found): (usize, usize), wanted: usize) -> MotionError {
        MotionError::Ragged {
            file: self.file.into(),
            line,
            wanted,
            found,
        }
    }

    /// How many names the last line of the header has, where these are parted like fields.
    fn names(&self, lines: &[HeaderLine<'_>]) -> Option<usize> {
        let line = lines.last().filter(|line| !line.is_comment())?;
        let names = match self.delimiter {
            Delimiter::Blank => Delimiter::Tab.cells(line.text.trim()).len(),
            other => other.cells(line.text).len(),
        };
        (names > 1).then_some(names)
    }
}

/// The statement of a first line with two numbers.
#[derive(Clone, Copy)]
struct Count {
    dt: f64,
    in_reading_order: bool,
}

/// Decimal signs in the numbers of a table.
#[derive(Default)]
struct Marks {
    has_point: bool,
    /// The first number with a comma.
    comma: Option<Comma>,
    /// Some number with a comma cannot be one with groups of thousands.
    is_proven: bool,
}

impl Marks {
    /// Refuses commas that may part thousands.
    fn judged(&self, file: &str, delimiter: Delimiter) -> Result<(), MotionError> {
        match &self.comma {
            Some(comma) if !self.is_proven && delimiter != Delimiter::Semicolon => {
                Err(comma.refused(file))
            }
            _ => Ok(()),
        }
    }
}

/// A number with a comma, and its place.
struct Comma {
    line: usize,
    column: usize,
    found: String,
}

impl Comma {
    fn of(line_number: usize, line: &str, start: usize, cell: &str) -> Self {
        let at = start + cell.find(',').unwrap_or(0);
        Self {
            line: line_number,
            column: line.get(..at).map_or(0, |before| before.chars().count()) + 1,
            found: shorten(cell),
        }
    }

    /// True unless the comma may part thousands: behind one to three digits, the first no zero, and before three.
    fn is_decimal(&self) -> bool {
        let (whole, decimals) = self.found.split_once(',').unwrap_or_default();
        let whole = whole.trim_start_matches(['+', '-']);
        let is_group = decimals.len() == 3 && (1..=3).contains(&whole.len());
        !is_group || whole.starts_with('0')
    }

    fn refused(&self, file: &str) -> MotionError {
        MotionError::DecimalComma {
            file: file.into(),
            line: self.line,
            column: self.column,
            found: self.found.clone(),
        }
    }
}
