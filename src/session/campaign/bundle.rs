//! Lists of chunks: those that are still open, and bundles of them for one job of a launcher.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use super::CampaignError;
use super::part::{merge, names};
use super::plan::Campaign;

/// Numbers of chunks in ascending order. As text: `3`, `3-8` or `1-4,7`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chunks(Vec<RangeInclusive<u64>>);

impl Chunks {
    /// The chunks `numbers`, which ascend.
    pub(super) fn of(numbers: &[u64]) -> Self {
        let mut ranges: Vec<RangeInclusive<u64>> = Vec::new();
        for number in numbers {
            match ranges.last_mut() {
                Some(last) if last.end() + 1 == *number => *last = *last.start()..=*number,
                _ => ranges.push(*number..=*number),
            }
        }
        Self(ranges)
    }

    /// The numbers.
    pub fn iter(&self) -> impl Iterator<Item = u64> + '_ {
        self.0.iter().cloned().flatten()
    }

    /// The first number; 0 for an empty list.
    #[must_use]
    pub fn first(&self) -> u64 {
        self.0.first().map_or(0, |range| *range.start())
    }

    /// The last number; 0 for an empty list.
    #[must_use]
    pub fn last(&self) -> u64 {
        self.0.last().map_or(0, |range| *range.end())
    }
}

impl fmt::Display for Chunks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, range) in self.0.iter().enumerate() {
            let comma = if place > 0 { "," } else { "" };
            let (start, end) = (range.start(), range.end());
            if start == end {
                write!(f, "{comma}{start}")?;
            } else {
                write!(f, "{comma}{start}-{end}")?;
            }
        }
        Ok(())
    }
}

impl FromStr for Chunks {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut ranges: Vec<RangeInclusive<u64>> = Vec::new();
        for piece in text.split(',') {
            let (start, end) = piece.split_once('-').unwrap_or((piece, piece));
            let (Ok(start), Ok(end)) = (start.parse(), end.parse()) else {
                return Err("expected numbers of chunks, such as 3, 3-8 or 1-4,7".to_owned());
            };
            if start > end || ranges.last().is_some_and(|last| *last.end() >= start) {
                return Err(format!("{piece} is not in ascending order"));
            }
            ranges.push(start..=end);
        }
        Ok(Self(ranges))
    }
}

/// Numbers of the chunks with tasks that have no result.
pub(super) fn open(campaign: &Campaign) -> Result<Vec<u64>, CampaignError> {
    let mut found = names(&campaign.folder)?;
    let mut open = Vec::new();
    let own = campaign.plan.digest();
    for chunk in 1..=campaign.plan.chunks() {
        let paths = found.remove(&chunk).unwrap_or_default();
        let parts = merge(&paths, &own, |index| campaign.identity(chunk, index))?;
        let mut tasks = campaign.plan.chunk(chunk);
        if tasks.any(|index| !parts.lines.contains_key(&index)) {
            open.push(chunk);
        }
    }
    Ok(open)
}

/// Divides `open` into lists of at least `tasks_per_job` tasks, rounded up to whole chunks. Without it a list has one chunk, or as
/// many as keep the number of lists at `most`.
pub(super) fn bundles(
    open: &[u64],
    tasks_per_chunk: u64,
    tasks_per_job: Option<u64>,
    most: u64,
) -> Result<Vec<Chunks>, CampaignError> {
    let chunks = open.len() as u64;
    let fewest = chunks.div_ceil(most.max(1)).max(1);
    let each = tasks_per_job.map_or(fewest, |tasks| tasks.div_ceil(tasks_per_chunk).max(1));
    if each < fewest {
        return Err(CampaignError::Other(format!(
            "--tasks-per-job {} gives {} array elements, and the cluster permits {most} (MaxArraySize): give at least \
             --tasks-per-job {}",
            tasks_per_job.unwrap_or_default(),
            chunks.div_ceil(each),
            (fewest - 1).saturating_mul(tasks_per_chunk) + 1
        )));
    }
    Ok(open.chunks(each as usize).map(Chunks::of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_chunks_is_read_and_written() {
        for (text, numbers) in [
            ("3", vec![3]),
            ("3-5", vec![3, 4, 5]),
            ("1-2,7", vec![1, 2, 7]),
        ] {
            let chunks: Chunks = text.parse().unwrap();
            assert_eq!(chunks.iter().collect::<Vec<_>>(), numbers);
            assert_eq!(Chunks::of(&numbers), chunks);
            assert_eq!(chunks.to_string(), text);
            assert_eq!(chunks.first(), numbers[0]);
            assert_eq!(chunks.last(), numbers[numbers.len() - 1]);
        }
        for text in ["", "a", "3-", "-3", "5-3", "3,3", "1-4,4-5", "1,,2", "1.5"] {
            assert!(text.parse::<Chunks>().is_err(), "{text}");
        }
    }

    #[test]
    fn bundles_have_every_open_chunk_once() {
        for (chunks, tasks_per_job, most, expected) in [
            (1, None, 1000, 1),
            (1000, None, 1000, 1000),
            (1001, None, 1000, 501),
            (2500, None, 1000, 834),
            // Seven tasks are two chunks of six.
            (2500, Some(7), 2000, 1250),
            (5, Some(1), 1000, 5),
            (5, Some(1_000_000), 1000, 1),
        ] {
            // Every second chunk is done.
            let open: Vec<u64> = (1..=chunks).map(|number| 2 * number).collect();
            let found = bundles(&open, 6, tasks_per_job, most).unwrap();
            assert_eq!(found.len(), expected);
            let all: Vec<u64> = found.iter().flat_map(Chunks::iter).collect();
            assert_eq!(all, open);
        }
    }

    #[test]
    fn too_small_bundle_names_the_least() {
        let open: Vec<u64> = (1..=2500).collect();
        let error = bundles(&open, 6, Some(6), 1000).unwrap_err().to_string();
        assert!(
            error.contains("2500") && error.contains("--tasks-per-job 13"),
            "{error}"
        );
        assert!(bundles(&open, 6, Some(12), 1000).is_err());
        assert_eq!(bundles(&open, 6, Some(13), 1000).unwrap().len(), 834);
    }
}
