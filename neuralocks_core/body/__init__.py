# SPDX-License-Identifier: Apache-2.0
"""The posed body that hair must stay out of: signed distances, exact and quick, and a statistical body."""
