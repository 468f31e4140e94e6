//! Parts of a status that are not sentences: bars, gauges, short numbers.

use gusset_quantity::units::quantity;
use gusset_view::live::Mark;

/// A value between its levels: `│` where it trips, `┊` where it warns, `·` where it has been, `●` where it is.
pub fn gauge(mark: &Mark, value: f64, peaks: [f64; 2], width: usize) -> String {
    let both = mark.trip.into_iter().chain(mark.warn);
    let farthest = both.filter(|level| level.is_finite()).map(f64::abs);
    let end = 1.1 * farthest.fold(0.0, f64::max);
    let start = if mark.size { 0.0 } else { -end };
    let cell = |at: f64| {
        let share = (at - start) / (end - start);
        (share.is_finite())
            .then(|| ((share.clamp(0.0, 1.0) * width as f64) as usize).min(width - 1))
    };
    let mut cells = vec![' '; width];
    if let (Some(low), Some(high)) = (cell(peaks[0]), cell(peaks[1])) {
        let low = if mark.size { 0 } else { low };
        cells
            .iter_mut()
            .take(high + 1)
            .skip(low)
            .for_each(|c| *c = '·');
    }
    for (levels, sign) in [(mark.warn, '┊'), (mark.trip, '│')] {
        for level in levels.into_iter().filter(|level| level.is_finite()) {
            if let Some(place) = cell(level).and_then(|place| cells.get_mut(place)) {
                *place = sign;
            }
        }
    }
    if let Some(place) = cell(value).and_then(|place| cells.get_mut(place)) {
        *place = '●';
    }
    let inside: String = cells.into_iter().collect();
    format!("[{inside}]")
}

/// A share of 1 as a bar.
pub fn bar(share: f64, width: usize) -> String {
    let filled = (share * width as f64).round() as usize;
    (0..width)
        .map(|i| if i < filled { '█' } else { '·' })
        .collect()
}

/// A short number; a dash if it does not exist.
pub fn short(value: f64, unit: &str) -> String {
    if value.is_nan() {
        return "-".to_owned();
    }
    if matches!(unit, "ticks" | "×" | "1") {
        return format!("{value:.3} {unit}");
    }
    let text = quantity(value, unit);
    let Some((number, unit)) = text.split_once(' ') else {
        return text;
    };
    match number.parse::<f64>() {
        Ok(number) => format!("{number:.2} {unit}"),
        Err(_) => text.clone(),
    }
}

/// Columns that it takes.
pub fn width(text: &str) -> usize {
    text.chars().count()
}

/// As much of it as there is room for.
pub fn cut(text: &str, columns: usize) -> String {
    text.chars().take(columns).collect()
}
