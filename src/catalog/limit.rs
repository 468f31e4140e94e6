//! What is limited: key, unit, what it is compared with, sentence.
