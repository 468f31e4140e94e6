//! Between the tests of a gateway's clients.

/// What holds the specimen of a gateway when the tests of its clients are over.
pub trait Held: std::fmt::Debug + Send + Sync {
    /// True if a specimen is held now.
    fn is_held(&self) -> bool;

    /// Ends it: the operator has said that the specimen is unloaded. False if some device did not follow.
    fn release(&self) -> bool;
}
