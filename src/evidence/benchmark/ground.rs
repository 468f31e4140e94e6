//! The synthetic earthquake of the benchmark.

use gusset_motion::{
    CloughPenzien, Envelope, JenningsHousner, KanaiTajimi, Motion, Processing, Signal,
};

/// Firm soil, 30 s of shaking and a tail; so strong that the actuator is at its limit in no case.
#[must_use]
pub fn synthetic(seed: u64) -> Motion {
    Motion {
        signal: Signal::KanaiTajimi(KanaiTajimi {
            ground_frequency_hz: None,
            ground_angular_frequency_rad_per_s: Some(15.0),
            ground_damping_ratio: 0.6,
            clough_penzien: Some(CloughPenzien {
                angular_frequency_rad_per_s: 1.5,
                damping_ratio: 0.6,
            }),
            envelope: Envelope::JenningsHousner(JenningsHousner {
                rise_s: 3.0,
                strong_s: 12.0,
                decay_per_s: 0.2,
            }),
            duration_s: 31.0,
            seed,
            peak: Some(0.8),
            unit: None,
            s0_m2_per_s3: None,
            cutoff_hz: 50.0,
            start_s: 0.0,
        }),
        processing: Processing {
            zero_tail: true,
            ..Processing::default()
        },
        delay_s: 0.0,
    }
}
