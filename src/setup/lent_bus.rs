//! The bus of a gateway: its devices stay in operation from one client's test to the next.

use std::sync::{Arc, Mutex};

use super::bus::{beyond_range, bus_plan, bus_source, drops_outputs, keeper, planned};
use super::held::Held;
use super::path;
use gusset_config::{BusClock, Finding, LinkSpec, ServedFile, SpecimenTable, TimingSpec};
use gusset_ethercat::plan::BusPlan;
use gusset_ethercat::{BusPort, SharedBus};
use gusset_link::served::{Controller, LinkBuild};

/// The bus of a gateway. It stays in operation from one client's test to the next.
#[derive(Debug)]
struct LentBus {
    plan: BusPlan,
    interface: String,
    timing: TimingSpec,
    shared: Mutex<Option<Arc<SharedBus>>>,
}

impl LentBus {
    /// The bus, which is not connected yet if it is new.
    fn shared(&self) -> Option<Arc<SharedBus>> {
        let mut place = self.shared.lock().ok()?;
        let known = place.take().filter(|shared| !shared.is_over());
        let shared = known.unwrap_or_else(|| {
            let interface = self.interface.clone();
            let open = move || super::bus_line::open(&interface);
            let keeper = keeper(&self.timing, self.plan.period_ns);
            let shared = SharedBus::new(
                self.plan.clone(),
                (bus_source(), 1),
                Box::new(open),
                Some(keeper),
            );
            shared.lend();
            shared
        });
        *place = Some(Arc::clone(&shared));
        Some(shared)
    }

    fn opened(&self) -> Option<Arc<SharedBus>> {
        self.shared.lock().ok()?.clone()
    }
}

impl Held for LentBus {
    fn is_held(&self) -> bool {
        self.opened().is_some_and(|shared| shared.is_held())
    }

    fn release(&self) -> bool {
        self.opened().is_none_or(|shared| shared.release())
    }
}

/// Links of a gateway to a specimen on a bus, and what holds it.
pub(super) fn gateway(
    source: &ServedFile,
    (table, link): (&SpecimenTable, &LinkSpec),
) -> Result<(LinkBuild, Arc<dyn Held>), Box<Finding>> {
    let at = &source.place;
    let units = table.units_of(table.axes());
    let units: Vec<_> = units.iter().map(|one| (one.metres, one.newtons)).collect();
    let (spec, bus, plan) = planned(at, (table, link), &source.file.bus, &units)?;
    let Some(pace) = &source.file.serve.pace else {
        let text = "a specimen on a bus gets a command in every tick, and this file does not say how its client's targets are paced";
        let finding = Finding::error(at.key("bus"), text);
        return Err(Box::new(finding.help(
            "copy [[specimen]] and [bus] into a file for `gusset serve` with [serve.pace]",
        )));
    };
    if bus.clock == BusClock::Follow {
        let text = "a gateway leads the clock of its bus";
        let finding = Finding::error(path("bus").key(&link.address).key("clock"), text);
        return Err(Box::new(finding.help("set `clock = \"free\"`")));
    }
    if let Some(finding) = drops_outputs(&link.address, bus, spec)
        .or_else(|| beyond_range(at, (table, spec), (bus, &plan), &units))
    {
        return Err(Box::new(finding));
    }
    let specimens = std::slice::from_ref(table);
    let lent = Arc::new(LentBus {
        plan: bus_plan(
            (specimens, pace.rate_hz.recip()),
            (link.address.as_str(), bus),
        ),
        interface: bus.interface.clone(),
        timing: source.file.timing.clone().unwrap_or_default(),
        shared: Mutex::new(None),
    });
    let held: Arc<dyn Held> = Arc::clone(&lent) as Arc<dyn Held>;
    let build: LinkBuild = Arc::new(move |_: &Controller| {
        let shared = lent
            .shared()
            .ok_or("internal error: a panic with the bus")?;
        Ok(Box::new(BusPort::new(shared, plan.clone())))
    });
    Ok((build, held))
}
