//! Tracking of one axis over the test: errors in moving windows, and estimates made while the test ran.

use super::canvas::Ink;
use super::charts::Quantity;
use super::lines::{Line, TimeChart};
use super::plots::still;
use super::rows::Rows;
use super::tracked::Tracked;

/// Kind of the column of the margin to the critical delay.
pub(super) const MARGIN: &str = "margin";

/// Amplitude and phase errors in moving windows.
pub(super) fn errors(axis: &Tracked<'_>) -> String {
    let Some((time, found)) = &axis.digest.course else {
        return String::new();
    };
    let mut markup = String::new();
    for (place, title, words, unit) in [
        (
            0,
            "Amplitude error in moving windows",
            "amplitude error",
            "1",
        ),
        (
            1,
            "Phase error in moving windows, negative: behind",
            "phase error",
            "rad",
        ),
    ] {
        let line = |name, y, ink, width| Line {
            name,
            x: time,
            y,
            ink: Ink::Series(ink),
            width,
        };
        let lines = [
            line("PAEI", &found.paei[place], 0, 1.8),
            line("FDB", &found.fdb[place], 1, 1.1),
        ];
        let chart = TimeChart::history(title, Quantity { words, unit }, &lines);
        markup += &still(&format!("{}: {title}", axis.name), &chart);
    }
    markup
}

/// Delay and gain as estimated while the test ran, if they were estimated.
pub(super) fn estimates(rows: &Rows<'_>, axis: &Tracked<'_>) -> String {
    let column = |kind: &str| rows.history(&axis.digest.axis.column(kind));
    let (Some(lag), Some(gain)) = (column("lag"), column("gain")) else {
        return String::new();
    };
    let margin = column(MARGIN);
    let mut markup = String::new();
    for (title, words, unit, values, ink) in [
        (
            "Delay as estimated while the test ran",
            "delay",
            "s",
            &lag,
            5,
        ),
        (
            "Gain as estimated while the test ran",
            "gain",
            "1",
            &gain,
            3,
        ),
    ]
    .into_iter()
    .chain(margin.as_ref().map(|margin| {
        let title = "Margin as estimated while the test ran: critical delay at the stiffness of the last seconds less their delay";
        (title, "margin", "s", margin, 7)
    })) {
        let lines = [values.line("", Ink::Series(ink), 1.2)];
        let up = Quantity { words, unit };
        let chart = TimeChart::history(title, up, &lines);
        markup += &still(&format!("{}: {title}", axis.name), &chart);
    }
    markup
}
