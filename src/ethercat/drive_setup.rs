//! Settings and checks of a drive before it may have torque (ETG.6010), over its mailbox.

use crate::axis_drive::wrong_mode;
use crate::error::BusError;
use crate::plan::DrivePlan;
use crate::request::{Known, Requests, Station};
use crate::wire::coe::Object;
use crate::wire::drive;
use gusset_wire::process_data::Entry;

/// First quick-stop option (605A) after which the drive keeps its torque.
const KEEPS_TORQUE: i16 = 5;

/// Checks and sets what a drive needs before it may have torque.
pub(crate) fn prepare_drive(
    requests: &mut Requests<'_>,
    station: &mut Station,
    plan: &DrivePlan,
    period_ns: u64,
) -> Result<(), BusError> {
    let object = |index, sub| Object { index, sub };
    let refuse = |why: String| BusError::Drive {
        device: station.name.clone(),
        why,
    };
    let (units, exponent) = interpolation_time(period_ns).ok_or_else(|| {
        let why = format!("60C2 cannot express a tick of {period_ns} ns: choose another rate");
        refuse(why)
    })?;
    let option: [u8; 2] = requests.upload_exact(station, object(drive::QUICK_STOP_OPTION, 0))?;
    let option = i16::from_le_bytes(option);
    if option < KEEPS_TORQUE && !plan.accepts_free_stop {
        let why = format!(
            "its quick-stop option 605A is {option}: the axis would have no torque afterwards. Set 5, 6 or 7, or accept it with \
             `accept = \"torque off at quick stop\"`"
        );
        return Err(BusError::Drive {
            device: station.name.clone(),
            why,
        });
    }
    if let Some(most) = plan.following_counts {
        let window = requests.upload_exact(station, object(drive::FOLLOWING_WINDOW, 0))?;
        let window = u32::from_le_bytes(window);
        if f64::from(window) > most {
            let why = format!(
                "its window of the following error 6065 is {window} counts, but the trip level of `following_error_m` is {most:.0}: \
                 the drive would not notice first. Set a smaller window"
            );
            return Err(BusError::Drive {
                device: station.name.clone(),
                why,
            });
        }
    }
    requests.download(station, object(drive::INTERPOLATION_TIME, 1), &[units])?;
    requests.download(
        station,
        object(drive::INTERPOLATION_TIME, 2),
        &[exponent as u8],
    )?;
    let [kept] = requests.upload_exact(station, object(drive::INTERPOLATION_TIME, 1))?;
    let [power] = requests.upload_exact(station, object(drive::INTERPOLATION_TIME, 2))?;
    if (kept, power as i8) != (units, exponent) {
        let power = power as i8;
        let why = format!(
            "its interpolation time 60C2 is {kept}·10^{power} s, but {units}·10^{exponent} s was written"
        );
        return Err(BusError::Drive {
            device: station.name.clone(),
            why,
        });
    }
    let mode = drive::CYCLIC_POSITION as u8;
    requests.download(station, object(drive::MODE, 0), &[mode])
}

/// A period as a number of units of 10^exponent s: the largest unit that divides it.
fn interpolation_time(period_ns: u64) -> Option<(u8, i8)> {
    (-9..=-1).rev().find_map(|exponent: i8| {
        let unit = 10u64.checked_pow(u32::try_from(9 + exponent).ok()?)?;
        let units = u8::try_from(period_ns / unit).ok()?;
        (period_ns.is_multiple_of(unit) && units > 0).then_some((units, exponent))
    })
}

/// A drive in SAFE-OP has no fault, and the mode that was written. A mode in the process data is written in OP only.
pub(crate) fn check_drive(
    requests: &mut Requests<'_>,
    device: &mut Known<'_>,
) -> Result<(), BusError> {
    let station = &mut device.station;
    let object = |index| Object { index, sub: 0 };
    let status = requests.upload_exact(station, object(drive::STATUSWORD))?;
    if drive::DriveState::of(u16::from_le_bytes(status)).is_fault() {
        let code = requests.upload_exact(station, object(drive::ERROR_CODE))?;
        let code = u16::from_le_bytes(code);
        return Err(BusError::Drive {
            device: station.name.clone(),
            why: format!(
                "it has the fault {code:#06x} (603F): remove its cause, then `gusset bus reset`"
            ),
        });
    }
    let is_mapped = |entry: &Entry| entry.index == drive::MODE;
    if device.plan.outputs.iter().any(is_mapped) {
        return Ok(());
    }
    let [found] = requests.upload_exact(station, object(drive::MODE_DISPLAY))?;
    if found as i8 == drive::CYCLIC_POSITION {
        return Ok(());
    }
    Err(BusError::Drive {
        device: station.name.clone(),
        why: wrong_mode(f64::from(found as i8)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_becomes_an_interpolation_time() {
        for (period_ns, wanted) in [
            (1_000_000, Some((1, -3))),
            (2_000_000, Some((2, -3))),
            (500_000, Some((5, -4))),
            (250_000, Some((25, -5))),
            (976_562, None),
        ] {
            assert_eq!(interpolation_time(period_ns), wanted, "{period_ns}");
        }
    }
}
