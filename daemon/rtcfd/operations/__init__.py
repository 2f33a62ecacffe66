"""Operations on one runner, one at a time."""
