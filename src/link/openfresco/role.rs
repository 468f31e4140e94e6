//! The program that a server takes the place of, and the kind of specimen behind it.

/// Which program a server takes the place of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Role {
    /// A: OpenFresco's `startSimAppElemServer`, for OpenSees `genericClient`, OpenFresco's elements, the C library.
    Application,
    /// B: OpenFresco's `expSite ActorSite`.
    Actor,
    /// D: a laboratory controller behind OpenFresco's `expControl GenericTCP` or `expControl SimFEAdapter`.
    Controller,
    /// D: the Simulink model behind OpenFresco's `expControl SimSimulink`.
    Simulink,
}

/// Whether a specimen can go back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Nature {
    /// A formula: a step that is taken back is forgotten, and each client finds it in its virgin state.
    #[default]
    Simulated,
    /// A physical specimen, or a gateway to one. A step that is taken back is refused and the test ends. A new client
    /// finds it at the end of the last test.
    Physical,
}
