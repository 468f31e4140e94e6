//! The phases of a test and their codes.
