//! The text exposition format 0.0.4 of Prometheus: families of samples with their labels.

use std::fmt::Write;

use super::latency::{BOUNDS, LatencyView};

/// A text that grows family by family.
#[derive(Debug)]
pub(super) struct Text(pub String);

impl Text {
    /// Begins a family.
    pub(crate) fn family(&mut self, name: &str, kind: &str, help: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}");
    }

    /// One sample; a NaN sample is omitted.
    pub(crate) fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: impl Into<f64>) {
        let value = value.into();
        if value.is_nan() {
            return;
        }
        let _ = write!(self.0, "{name}");
        for (place, (key, text)) in labels.iter().enumerate() {
            let open = if place == 0 { '{' } else { ',' };
            let _ = write!(self.0, "{open}{key}=\"{}\"", escaped(text));
        }
        let close = if labels.is_empty() { "" } else { "}" };
        let _ = writeln!(self.0, "{close} {}", number(value));
    }

    /// A family of one sample without labels.
    pub(crate) fn one(&mut self, name: &str, kind: &str, help: &str, value: impl Into<f64>) {
        self.family(name, kind, help);
        self.sample(name, &[], value);
    }

    /// A family of buckets that add up.
    pub(crate) fn histogram(&mut self, name: &str, help: &str, view: &LatencyView) {
        self.family(name, "histogram", help);
        let bucket = format!("{name}_bucket");
        let mut sum = 0;
        let ends = BOUNDS.iter().map(|bound| number(*bound));
        for (count, end) in view.buckets.iter().zip(ends.chain(["+Inf".to_owned()])) {
            sum += count;
            self.sample(&bucket, &[("le", &end)], sum as f64);
        }
        self.sample(&format!("{name}_sum"), &[], view.sum);
        self.sample(&format!("{name}_count"), &[], view.count as f64);
    }
}

fn number(value: f64) -> String {
    if value == f64::INFINITY {
        "+Inf".to_owned()
    } else if value == f64::NEG_INFINITY {
        "-Inf".to_owned()
    } else {
        format!("{value:?}")
    }
}

fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\")
        .replace('"', "\\\"")
        .replace('\n', "\\n")
}
